"""Parameters by class and over the backlash size, and parameters between two sets."""

from __future__ import annotations

import bisect
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from itertools import pairwise, zip_longest
from pathlib import Path
from typing import Any

from endoscope_core.atomic_output import write_text
from endoscope_core.choices import PHYSICAL
from endoscope_core.control.feedforward import LawParameters
from endoscope_core.control.internal_model import PhysicalParameters
from endoscope_core.errors import FileError, InputError
from endoscope_core.hysteresis import MODELS, BoucWenParameters, DahlParameters
from endoscope_core.physics import JointParameters
from endoscope_core.physics.family import SIGNED
from endoscope_core.physics.layout import NOMINAL_KEYS
from endoscope_core.schema import read

KINDS: dict[str, type[LawParameters]] = {**MODELS, PHYSICAL: PhysicalParameters}
"""Kind of parameters by the name of the model; 'physical' is the plant itself."""

_NO_LAG = 1e-12
SAME_SIZE = math.radians(0.5)


def blend(first: LawParameters, second: LawParameters, weight: float) -> LawParameters:
    """Parameters at `weight` in [0, 1] of the way from one set to another of the same kind.

    Gains, lags, offsets and the steepness ``slope alpha - 1`` are interpolated, not the travels:
    the slope of the inverse, a quotient of two linear functions, then lies between those of the two
    sets. Parameters of the plant are interpolated by their logarithms.

    ValueError if the kinds differ or the weight is out of range.
    """
    if not 0.0 <= weight <= 1.0:
        raise ValueError(f'weight = {weight} must lie in [0, 1]')
    if weight in (0.0, 1.0):
        return second if weight else first
    if isinstance(first, BoucWenParameters) and isinstance(second, BoucWenParameters):
        alpha, lag, steepness, rho, n = _between(
            _bouc_wen_point(first), _bouc_wen_point(second), weight
        )
        travel = _travel(lag, max(1.0, 1.0 + rho), steepness)
        return BoucWenParameters.from_shape(alpha, lag, travel, rho, n)
    if isinstance(first, DahlParameters) and isinstance(second, DahlParameters):
        alpha, lag, steepness, exponent, offset = _between(
            _dahl_point(first), _dahl_point(second), weight
        )
        return DahlParameters(alpha, lag, _travel(lag, 2.0**exponent, steepness), exponent, offset)
    if isinstance(first, PhysicalParameters) and isinstance(second, PhysicalParameters):
        return PhysicalParameters(blend_joints(first.joint, second.joint, weight))
    raise ValueError(f'{type(first).__name__} and {type(second).__name__} cannot be blended')


Point = tuple[float, ...]


def blend_joints(first: JointParameters, second: JointParameters, weight: float) -> JointParameters:
    """Joint at `weight` in [0, 1] between two: by logarithms, straight what may have any sign."""
    blended = {}
    for key in NOMINAL_KEYS:
        a, b = getattr(first, key), getattr(second, key)
        blended[key] = a + weight * (b - a) if key in SIGNED else _geometric(a, b, weight)
    pairs = zip_longest(first.friction_profile, second.friction_profile, fillvalue=0.0)
    profile = tuple(a + weight * (b - a) for a, b in pairs)
    return JointParameters(**blended, friction_profile=profile)


def _between(first: Point, second: Point, weight: float) -> list[float]:
    return [a + weight * (b - a) for a, b in zip(first, second, strict=True)]


def _geometric(first: float, second: float, weight: float) -> float:
    """Between two numbers by their logarithms, or straight where one of them is zero."""
    if first > 0.0 and second > 0.0:
        return math.exp(math.log(first) + weight * (math.log(second) - math.log(first)))
    return first + weight * (second - first)


def _travel(lag: float, steepest: float, steepness: float) -> float:
    return steepest * lag / steepness if steepness > _NO_LAG else 1.0


def _bouc_wen_point(p: BoucWenParameters) -> Point:
    return p.alpha, p.lag, p.inverse_slope * p.alpha - 1.0, p.rho, p.n


def _dahl_point(p: DahlParameters) -> Point:
    return p.alpha, p.lag, p.inverse_slope * p.alpha - 1.0, p.exponent, p.offset


@dataclass(frozen=True)
class TableEntry:
    """One calibrated configuration, named by its backlash size in rad."""

    size: float  # backlash size in rad, which stands for the configuration
    parameters: LawParameters
    source: str = ''  # what it was identified from, in words


@dataclass(frozen=True)
class UpdatedTable:
    """Parameters over the backlash size (second paper: updated table with offline learning).

    The paper looks up a configuration that was learnt before. Here the configuration is the
    backlash size that the calibration regressed, and between two entries the parameters are blended
    (`blend`), which keeps them safe; beyond the first and the last nothing is extrapolated.

    InputError if the model is unknown, an entry is of another kind, a size is not finite and
    positive, or sizes do not increase.
    """

    model: str  # name of the model, one of `KINDS`
    entries: tuple[TableEntry, ...]  # sorted by size

    def __post_init__(self) -> None:
        if self.model not in KINDS:
            raise InputError(f'unknown model {self.model!r}: choose one of {", ".join(KINDS)}')
        if not self.entries:
            raise InputError('a table needs at least one entry')
        for entry in self.entries:
            if not (math.isfinite(entry.size) and entry.size > 0.0):
                raise InputError(f'backlash size {entry.size} must be positive and finite')
            if not isinstance(entry.parameters, KINDS[self.model]):
                raise InputError(
                    f'an entry of a {self.model} table holds {type(entry.parameters).__name__}'
                )
        sizes = self.sizes
        if any(after <= before for before, after in pairwise(sizes)):
            raise InputError('the sizes of a table must increase')

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

        InputError if the size is not finite or outside the table: parameters are never
        guessed.
        """
        sizes = self.sizes
        if not sizes[0] <= size <= sizes[-1]:
            raise InputError(
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

        OSError if the file cannot be written.
        """
        content = {
            'schema': 1,
            'model': self.model,
            'entries': [
                {
                    'size': entry.size,
                    'parameters': dict(entry.parameters.to_dict()),
                    'source': entry.source,
                }
                for entry in self.entries
            ],
        }
        write_text(path, json.dumps(content, indent=1) + '\n')

    @classmethod
    def load(cls, path: str | Path) -> UpdatedTable:
        """Read a table.

        FileError if the file is missing, holds something else, or unsafe parameters.
        """
        path = Path(path)
        if not path.is_file():
            raise FileError(f'{path} is missing: make a table with `endoscope identify`')
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
            raise FileError(f'{path} holds no updated table: {error}') from error


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


def parameters_from_dict(model: str, values: Mapping[str, Any]) -> LawParameters:
    """Parameters of a model from exactly their names; a ValueError if not so, or if unsafe."""
    if model not in KINDS:
        raise ValueError(f'unknown model {model!r}: choose one of {", ".join(KINDS)}')
    return KINDS[model].from_dict(values)


def shipped_table_path(model: str) -> Path:
    """Where the class parameters of a model lie that come with this package."""
    name = f'{model}_classes.json'
    return Path(str(files('endoscope_core.identification') / 'parameters' / name))


def load_class_parameters(
    path: str | Path | None = None, model: str = 'bouc_wen'
) -> dict[int, LawParameters]:
    """Feed-forward parameters of a model by class (backlash size in deg); the shipped by default.

    FileError if the file is missing, holds something else or another model, or unsafe parameters.
    """
    path = shipped_table_path(model) if path is None else Path(path)
    if not path.is_file():
        raise FileError(
            f'{path} is missing: make parameter sets with `endoscope fit classes DATASET '
            f'--model {model}`'
        )
    try:
        file = read(_ClassesFile, json.loads(path.read_text(encoding='utf-8')), path.name)
        sets = file.classes if file.model == model else {}
        parameters = {
            int(class_deg): parameters_from_dict(model, found.feedforward)
            for class_deg, found in sets.items()
        }
    except (ValueError, TypeError, RecursionError) as error:
        raise FileError(f'{path} holds no {model} parameter sets: {error}') from error
    if file.model != model:
        raise FileError(f'{path} holds parameters of {file.model}, not of {model}')
    return parameters


@dataclass(frozen=True)
class _Class:
    feedforward: Mapping[str, Any]
    model: Any = None
    model_rmse: Any = None


@dataclass(frozen=True)
class _ClassesFile:
    model: str
    classes: Mapping[str, _Class]
    schema: Any = 1
    command: Any = None
    dataset_manifest_sha256: Any = None
    lead: Any = None


def parameters_for_class(sets: Mapping[int, LawParameters], class_deg: int) -> LawParameters:
    """The set of a class.

    InputError if there is none: parameters are never guessed.
    """
    if class_deg not in sets:
        known = ', '.join(str(c) for c in sorted(sets))
        raise InputError(f'no parameters for class {class_deg} deg (there are {known})')
    return sets[class_deg]
