"""rig.yaml: gear, limits, time-outs and devices of a rig, said once for every node."""

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import yaml

from endoscope_core.choices import LOAD_CELL_DEVICES, MOTOR_DEVICES, TRACKER_DEVICES
from endoscope_core.errors import EndoscopeError, nearest
from endoscope_core.strict_yaml import YamlError, load_yaml, parse_yaml

SHIPPED = Path(__file__).with_name('rig.yaml')


class RigFileError(EndoscopeError, ValueError):
    """A rig file that cannot be used; the message names the file, the key and what to do."""


def _fact(low: float, high: float) -> Any:
    """A number within bounds."""

    def checked(value: Any) -> float:
        wanted = f'give a number from {low:g} to {high:g}'
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(wanted)
        if not low <= value <= high:
            raise ValueError(wanted)
        return float(value)

    return field(metadata={'checked': checked})


def _choice(*choices: str) -> Any:
    def checked(value: Any) -> str:
        if value not in choices:
            raise ValueError(f'give one of {", ".join(choices)}')
        return str(value)

    return field(metadata={'checked': checked})


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError('give a text')
    return value


def _name() -> Any:
    def checked(value: Any) -> str:
        if not isinstance(value, str) or not re.fullmatch('[A-Za-z][A-Za-z0-9_]*', value):
            raise ValueError('give a name of letters, digits and underscores')
        return value

    return field(metadata={'checked': checked})


def _count(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ValueError('give a whole number from 0 on')
    return value


@dataclass(frozen=True)
class JointFacts:
    """What is the same for every joint of the bending section.

    Attributes
    ----------
    gear
        Shaft angle for one radian at the joint.
    reach
        Largest desired bending in rad, either way.
    drive
        Largest joint-equivalent motor angle in rad, either way; what compensation adds to the
        desired bending has its place between the two.
    correction
        Largest correction by feedback in rad, either way.
    speed, acceleration
        Largest of a desired angle, in rad/s and rad/s^2.
    hand_speed
        Largest speed in rad/s of a joint that follows the handle.
    entry_step
        Largest distance in rad from the measured pose to the first command of a stream.
    """

    gear: float = _fact(0.01, 100.0)
    reach: float = _fact(0.1, 3.1)
    drive: float = _fact(0.1, 10.0)
    correction: float = _fact(0.0, 3.1)
    speed: float = _fact(0.01, 100.0)
    acceleration: float = _fact(0.1, 1e4)
    hand_speed: float = _fact(0.01, 20.0)
    entry_step: float = _fact(0.001, 1.0)


@dataclass(frozen=True)
class MotorFacts:
    """What is the same for every motor shaft.

    Attributes
    ----------
    reach
        Largest shaft angle in rad, either way.
    speed, acceleration
        Largest of a shaft, in rad/s and rad/s^2.
    step
        Largest distance in rad of two goals that follow each other.
    entry_step
        Largest distance in rad from the measured position to the first command of a stream.
    resolution
        One count of their encoders in rad.
    """

    reach: float = _fact(0.01, 20.0)
    speed: float = _fact(0.01, 100.0)
    acceleration: float = _fact(0.1, 1e5)
    step: float = _fact(1e-4, 1.0)
    entry_step: float = _fact(0.001, 1.0)
    resolution: float = _fact(0.0, 0.1)


@dataclass(frozen=True)
class Timeouts:
    """How long something may be silent, in s.

    Attributes
    ----------
    command
        A command older than this is not obeyed, and a stream that pauses longer has ended.
    stream
        Silence of motors or load cells at which the slave goes to FAULT.
    handle
        Silence of the handle after which it counts as released.
    """

    command: float = _fact(0.001, 1.0)
    stream: float = _fact(0.005, 10.0)
    handle: float = _fact(0.01, 1.0)

    @cached_property
    def command_ns(self) -> int:
        """`command` in ns."""
        return round(self.command * 1e9)

    @cached_property
    def handle_ns(self) -> int:
        """`handle` in ns."""
        return round(self.handle * 1e9)

    @cached_property
    def stream_ns(self) -> int:
        """`stream` in ns."""
        return round(self.stream * 1e9)


@dataclass(frozen=True)
class TensionFacts:
    """Tensions of a wire in N."""

    ceiling: float = _fact(0.1, 500.0)  # at which the slave goes to FAULT
    calibration_ceiling: float = _fact(0.1, 500.0)  # at which a calibration is aborted


@dataclass(frozen=True)
class HandleFacts:
    """The console's handle.

    Attributes
    ----------
    resolution
        One count of its encoders in rad.
    """

    resolution: float = _fact(0.0, 0.1)


@dataclass(frozen=True)
class InstrumentFacts:
    """The instrument's end.

    Attributes
    ----------
    section_length
        Length of the bending section in m.
    base_frame
        Frame of its beginning, z along the straight instrument: that of all poses.
    """

    section_length: float = _fact(0.001, 0.5)
    base_frame: str = _name()


@dataclass(frozen=True)
class DeviceFacts:
    """What stands on the table and what is simulated.

    Attributes
    ----------
    motors, load_cells, tracker
        One of `MOTOR_DEVICES`, `LOAD_CELL_DEVICES` and `TRACKER_DEVICES`.
    """

    motors: str = _choice(*MOTOR_DEVICES)
    load_cells: str = _choice(*LOAD_CELL_DEVICES)
    tracker: str = _choice(*TRACKER_DEVICES)


@dataclass(frozen=True)
class RecordingFacts:
    """When a recording ends that nobody asked for.

    Attributes
    ----------
    rest
        How long in s the slave has not been enabled by then; its next session begins another one.
    room
        MB of all such recordings in one run of the graph, after which there are no more; 0: none.
    """

    rest: float = _fact(1.0, 1e6)
    room: float = _fact(0.0, 1e6)


@dataclass(frozen=True)
class SimulationFacts:
    """The simulated slave.

    Attributes
    ----------
    plant
        Path of its plant.yaml; empty for the nominal plant.
    seed
        Of the noise of its sensors.
    """

    plant: str = field(metadata={'checked': _text})
    seed: int = field(metadata={'checked': _count})


@dataclass(frozen=True)
class Rig:
    """A rig; see the classes of its parts.

    Raises
    ------
    ValueError
        If `drive` times gear is beyond the reach of a shaft.
    """

    joints: JointFacts
    motors: MotorFacts
    timeouts: Timeouts
    tension: TensionFacts
    handle: HandleFacts
    instrument: InstrumentFacts
    devices: DeviceFacts
    recording: RecordingFacts
    simulation: SimulationFacts

    def __post_init__(self) -> None:
        shaft = self.joints.drive * self.joints.gear
        if shaft > self.motors.reach:
            raise ValueError(
                f'joints.drive times gear is {shaft:g} rad of the shaft, beyond motors.reach '
                f'{self.motors.reach:g}'
            )


def load_rig(path: str | Path | None = None) -> Rig:
    """Read a rig.yaml; what it does not say is as in the one that is shipped.

    Parameters
    ----------
    path
        The file; the shipped one by default.

    Raises
    ------
    RigFileError
        It cannot be read, has an unknown key, or a value out of range.
    """
    if path is None or not str(path):
        return _rig({}, 'the shipped rig')
    rig = _rig(_content(Path(path)), f'rig file {path}')
    if not rig.simulation.plant:
        return rig
    plant = Path(path).parent / rig.simulation.plant
    return replace(rig, simulation=replace(rig.simulation, plant=str(plant)))


def rig_as_text(rig: Rig) -> str:
    """All facts of a rig as YAML, for a recording of it."""
    return yaml.safe_dump(asdict(rig), sort_keys=False)


def rig_from_text(text: str, name: str) -> Rig:
    """Read what `rig_as_text` wrote.

    Parameters
    ----------
    text
    name
        Where it stands, for messages.

    Raises
    ------
    RigFileError
        It has an unknown key, or a value out of range.
    """
    try:
        return _rig(_mapping(parse_yaml(text, name), name), name)
    except YamlError as error:
        raise RigFileError(str(error)) from error


@cache
def shipped_rig() -> Rig:
    """The rig that comes with the project."""
    return load_rig()


def _content(path: Path) -> Mapping[str, Any]:
    try:
        return _mapping(load_yaml(path), f'rig file {path}')
    except YamlError as error:
        raise RigFileError(str(error)) from error


def _mapping(content: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(content, Mapping):
        raise RigFileError(f'{where} has to be a mapping')
    return content


def _rig(own: Mapping[str, Any], where: str) -> Rig:
    shipped = _content(SHIPPED)
    parts = {f.name: f.type for f in fields(Rig)}
    _check_keys(own, parts, where)
    made = {
        name: _part(kind, shipped[name], own.get(name), f'{where}: {name}')
        for name, kind in parts.items()
    }
    try:
        return Rig(**made)
    except ValueError as error:
        raise RigFileError(f'{where}: {error}') from error


def _part(kind: Any, shipped: Mapping[str, Any], own: Any, where: str) -> Any:
    if own is None:
        own = {}
    if not isinstance(own, Mapping):
        raise RigFileError(f'{where} has to be a mapping, not {own!r}')
    known = {f.name: f.metadata['checked'] for f in fields(kind)}
    _check_keys(own, known, where)
    values = {}
    for name, checked in known.items():
        value = own.get(name, shipped[name])
        try:
            values[name] = checked(value)
        except ValueError as error:
            raise RigFileError(f'{where}.{name} is {value!r}: {error}') from error
    return kind(**values)


def _check_keys(given: Mapping[str, Any], known: Mapping[str, Any], where: str) -> None:
    for key in given:
        if key not in known:
            raise RigFileError(f'{where}: unknown key {key}: {nearest(str(key), tuple(known))}')
