"""What a report is made from: files with their hashes, program and command."""

import hashlib
from datetime import datetime
from importlib.metadata import version
from pathlib import Path

from endoscope_explain.case import Provenance


def provenance(bag: Path, plant: Path | None, command: str) -> Provenance:
    """Note what a report is made from, now: the bag's files and the plant's by their hashes."""
    messages = sorted(p for p in bag.iterdir() if p.suffix != '.yaml') if bag.is_dir() else [bag]
    return Provenance(
        str(bag),
        _sha256(*messages),
        '' if plant is None else str(plant),
        '' if plant is None else _sha256(plant),
        version('endoscope_explain'),
        command,
        datetime.now().astimezone().isoformat(timespec='seconds'),
    )


def _sha256(*files: Path) -> str:
    digest = hashlib.sha256()
    for file in files:
        with file.open('rb') as stream:
            while block := stream.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()
