"""The files of a report, and what it is made from: files with their hashes, program, command."""

import hashlib
import json
from datetime import datetime
from importlib.metadata import version
from pathlib import Path

from endoscope_core.physics.plant_file import save_plant
from endoscope_core.signals.command_file import JOINTS, write_command_file
from endoscope_explain.case import ExplainedCase, Provenance
from endoscope_explain.report.html_page import html_page
from endoscope_explain.report.report_mapping import EXPERIMENT_FILE, report_mapping


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


REPORT_JSON = 'report.json'
REPORT_HTML = 'report.html'
PLANT_YAML = 'plant.yaml'


def write_report(case: ExplainedCase, folder: Path) -> None:
    """Write report.json, report.html, plant.yaml and any next motion to a folder that exists."""
    content = json.dumps(report_mapping(case), indent=1, allow_nan=False)
    (folder / REPORT_JSON).write_text(content + '\n', encoding='utf-8')
    (folder / REPORT_HTML).write_text(html_page(case), encoding='utf-8')
    save_plant(case.plant, folder / PLANT_YAML)
    if case.next_experiment is not None:
        experiment = case.next_experiment
        columns = dict(zip(experiment.joints, zip(*experiment.command, strict=True), strict=True))
        # A console plays all joints; one that was not recorded stays at zero.
        joints = tuple(dict.fromkeys((*JOINTS, *experiment.joints)))
        still = (0.0,) * len(experiment.time)
        command = list(zip(*(columns.get(joint, still) for joint in joints), strict=True))
        write_command_file(folder / EXPERIMENT_FILE, experiment.time, command, joints)
