"""The updated table: from the configuration of the tube to the parameters of a compensator."""

from __future__ import annotations

import bisect
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

from endoscope_core.atomic_output import write_text
from endoscope_core.errors import EndoscopeError
from endoscope_core.identification.parameter_blend import KINDS, LawParameters, blend
from endoscope_core.schema import read

SAME_SIZE = math.radians(0.5)


class UpdatedTableError(EndoscopeError, ValueError):
    """A table that cannot be read, or a configuration that it does not cover."""


@dataclass(frozen=True)
class TableEntry:
    """One calibrated configuration.

    Parameters
    ----------
    size : float
        Backlash size in rad, which stands for the configuration.
    parameters : LawParameters
    source : str
        What it was identified from, in words.
    """

    size: float
    parameters: LawParameters
    source: str = ''


@dataclass(frozen=True)
class UpdatedTable:
    """Parameters over the backlash size (second paper: updated table with offline learning).

    The paper looks up a configuration that was learnt before. Here the configuration is the
    backlash size that the calibration regressed, and between two entries the parameters are blended
    (`blend`), which keeps them safe; beyond the first and the last nothing is extrapolated.

    Parameters
    ----------
    model : str
        Name of the model, one of `KINDS`.
    entries : tuple of TableEntry
        Sorted by size.

    Raises
    ------
    UpdatedTableError
        If the model is unknown, an entry is of another kind, a size is not finite and positive, or
        sizes do not increase.
    """

    model: str
    entries: tuple[TableEntry, ...]

    def __post_init__(self) -> None:
        if self.model not in KINDS:
            raise UpdatedTableError(
                f'unknown model {self.model!r}: choose one of {", ".join(KINDS)}'
            )
        if not self.entries:
            raise UpdatedTableError('a table needs at least one entry')
        for entry in self.entries:
            if not (math.isfinite(entry.size) and entry.size > 0.0):
                raise UpdatedTableError(f'backlash size {entry.size} must be positive and finite')
            if not isinstance(entry.parameters, KINDS[self.model]):
                raise UpdatedTableError(
                    f'an entry of a {self.model} table holds {type(entry.parameters).__name__}'
                )
        sizes = self.sizes
        if any(after <= before for before, after in pairwise(sizes)):
            raise UpdatedTableError('the sizes of a table must increase')

    @classmethod
    def of(cls, model: str, entries: Iterable[TableEntry]) -> UpdatedTable:
        """A table of entries in any order."""
        return cls(model, tuple(sorted(entries, key=lambda entry: entry.size)))

    @classmethod
    def of_classes(cls, model: str, sets: Mapping[int, LawParameters]) -> UpdatedTable:
        """A table whose configurations are hysteresis classes, named by their size in deg."""
        return cls.of(
            model,
            [
                TableEntry(math.radians(class_deg), parameters, f'class {class_deg} deg')
                for class_deg, parameters in sets.items()
            ],
        )

    @property
    def sizes(self) -> tuple[float, ...]:
        """Backlash sizes in rad."""
        return tuple(entry.size for entry in self.entries)

    def parameters_for(self, size: float) -> LawParameters:
        """Parameters for a backlash size in rad.

        Raises
        ------
        UpdatedTableError
            If the size is not finite or outside the table: parameters are never guessed.
        """
        sizes = self.sizes
        if not sizes[0] <= size <= sizes[-1]:
            raise UpdatedTableError(
                f'backlash size {math.degrees(size):.1f} deg is outside the table, which covers '
                f'{math.degrees(sizes[0]):.1f} to {math.degrees(sizes[-1]):.1f} deg: calibrate '
                'with the tracker and extend the table'
            )
        after = bisect.bisect_left(sizes, size)
        if sizes[after] == size:
            return self.entries[after].parameters
        weight = (size - sizes[after - 1]) / (sizes[after] - sizes[after - 1])
        return blend(self.entries[after - 1].parameters, self.entries[after].parameters, weight)

    def extended(self, entry: TableEntry) -> UpdatedTable:
        """The table with one calibration more; it takes the place of entries within 0.5 deg."""
        kept = [old for old in self.entries if abs(old.size - entry.size) > SAME_SIZE]
        return UpdatedTable.of(self.model, [*kept, entry])

    def save(self, path: str | Path) -> None:
        """Write the table, whole or not at all.

        Raises
        ------
        OSError
            If the file cannot be written.
        """
        content = {
            'schema': 1,
            'model': self.model,
            'entries': [
                {
                    'size': entry.size,
                    'parameters': parameters_to_dict(entry.parameters),
                    'source': entry.source,
                }
                for entry in self.entries
            ],
        }
        write_text(path, json.dumps(content, indent=1) + '\n')

    @classmethod
    def load(cls, path: str | Path) -> UpdatedTable:
        """Read a table.

        Raises
        ------
        UpdatedTableError
            If the file is missing, holds something else, or unsafe parameters.
        """
        path = Path(path)
        if not path.is_file():
            raise UpdatedTableError(f'{path} is missing: make a table with `endoscope identify`')
        try:
            file = read(_File, json.loads(path.read_text(encoding='utf-8')), path.name)
            entries = [
                TableEntry(
                    entry.size, parameters_from_dict(file.model, entry.parameters), entry.source
                )
                for entry in file.entries
            ]
            return cls.of(file.model, entries)
        except (ValueError, TypeError, RecursionError) as error:
            raise UpdatedTableError(f'{path} holds no updated table: {error}') from error


@dataclass(frozen=True)
class _Entry:
    size: float
    parameters: Mapping[str, Any]
    source: str = ''


@dataclass(frozen=True)
class _File:
    model: str
    entries: tuple[_Entry, ...]
    schema: Any = 1


def parameters_to_dict(parameters: LawParameters) -> dict[str, Any]:
    """Parameters of any model by name."""
    return dict(parameters.to_dict())


def parameters_from_dict(model: str, values: Mapping[str, Any]) -> LawParameters:
    """Parameters of a model from exactly their names; a ValueError if not so, or if unsafe."""
    if model not in KINDS:
        raise ValueError(f'unknown model {model!r}: choose one of {", ".join(KINDS)}')
    return KINDS[model].from_dict(values)


def shipped_table_path(model: str) -> Path:
    """Where the class parameters of a model lie that come with this package."""
    name = f'{model}_classes.json'
    return Path(str(files('endoscope_core.identification') / 'parameters' / name))
