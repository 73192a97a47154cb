"""Reads YAML files of devices: unknown keys, wrong types and missing values are refused by name."""

import difflib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from endoscope_core.errors import EndoscopeError, FileError
from endoscope_core.strict_yaml import load_yaml


class DeviceFileError(EndoscopeError, ValueError):
    """A file about a device that cannot be used; the message names the file and the key."""


class Section:
    """One mapping of a YAML file; DeviceFileError where it is none or has an unknown key."""

    def __init__(self, where: str, content: Any, keys: Sequence[str]) -> None:
        if not isinstance(content, Mapping):
            raise DeviceFileError(f'{where} has to be a mapping with {", ".join(keys)}')
        for key in content:
            if key not in keys:
                near = difflib.get_close_matches(str(key), keys, 1, 0.4)
                hint = f'did you mean {near[0]}?' if near else f'known are {", ".join(keys)}'
                raise DeviceFileError(f'{where}: unknown key {key}: {hint}')
        self._where = where  # file and path of keys so far, for messages
        self._content = content

    def section(self, key: str, keys: Sequence[str], *, required: bool = True) -> 'Section':
        """The mapping under ``key``; an empty one where it is missing and not required."""
        content = self._content.get(key)
        if content is None and not required:
            content = {}
        if content is None:
            raise DeviceFileError(f'{self._where}: {key} is missing')
        return Section(f'{self._where}: {key}', content, keys)

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        """The finite number under ``key``, in its unit; required where there is no default."""
        value = self._given(key, default)
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not low <= value <= high
        ):
            raise DeviceFileError(
                f'{self._where}: {key} is {value!r}: give a number from {low:g} to {high:g}'
            )
        return float(value)

    def whole(self, key: str, low: int, high: int, default: int | None = None) -> int:
        """The whole number under ``key``; required where there is no default."""
        value = self._given(key, default)
        if type(value) is not int or not low <= value <= high:
            raise DeviceFileError(
                f'{self._where}: {key} is {value!r}: give a whole number from {low} to {high}'
            )
        return value

    def sign(self, key: str, default: int | None = None) -> int:
        """The 1 or -1 under ``key``; required where there is no default."""
        value = self._given(key, default)
        if type(value) is not int or value not in (1, -1):
            raise DeviceFileError(f'{self._where}: {key} is {value!r}: give 1 or -1')
        return value

    def choice(self, key: str, choices: Sequence[str], default: str | None = None) -> str:
        """The word under ``key``, one of ``choices``."""
        value = self._given(key, default)
        if value not in choices:
            raise DeviceFileError(
                f'{self._where}: {key} is {value!r}: give one of {", ".join(choices)}'
            )
        return str(value)

    def vector(self, key: str, length: int) -> tuple[float, ...]:
        """The ``length`` finite numbers under ``key``."""
        value = self._given(key, None)
        if (
            not isinstance(value, list)
            or len(value) != length
            or any(isinstance(v, bool) or not isinstance(v, int | float) for v in value)
            or not all(math.isfinite(v) for v in value)
        ):
            raise DeviceFileError(f'{self._where}: {key} is {value!r}: give {length} numbers')
        return tuple(float(v) for v in value)

    def text(self, key: str) -> str:
        """The text under ``key``."""
        value = self._given(key, None)
        if not isinstance(value, str):
            raise DeviceFileError(f'{self._where}: {key} is {value!r}: give a text')
        return value

    def _given(self, key: str, default: Any) -> Any:
        value = self._content.get(key, default)
        if value is None:
            raise DeviceFileError(f'{self._where}: {key} is missing')
        return value


def load_section(path: str | Path, what: str, keys: Sequence[str]) -> Section:
    """Read a YAML file, called `what` in messages, of one mapping; DeviceFileError if it is not."""
    try:
        content = load_yaml(path)
    except FileError as error:
        raise DeviceFileError(f'{what}: {error}') from error
    return Section(f'{what} {path}', content, keys)
