"""The seal: a truth is written, and its digest is told, before anybody looks for it."""

import hashlib
import json
import secrets
from pathlib import Path

from endoscope_core.errors import EndoscopeError


class BrokenSealError(EndoscopeError, ValueError):
    """A truth is not what was sealed."""


def seal(path: Path, truth: dict) -> str:
    """Write a truth as JSON and return the SHA-256 of the file, in hex."""
    # Without a number of its own a truth of few words could be guessed from its digest.
    content = json.dumps(truth | {'salt': secrets.token_hex(16)}, indent=1, default=str)
    path.write_text(content + '\n', encoding='utf-8')
    return digest(path)


def opened(path: Path, told: str) -> dict:
    """Read a truth whose digest was told before; BrokenSealError if the file is another one now."""
    if digest(path) != told:
        raise BrokenSealError(f'{path}: its SHA-256 is not the one that was told: it was changed')
    truth: dict = json.loads(path.read_text(encoding='utf-8'))
    return truth


def digest(path: Path) -> str:
    """SHA-256 of a file, in hex, as `sha256sum` prints it."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
