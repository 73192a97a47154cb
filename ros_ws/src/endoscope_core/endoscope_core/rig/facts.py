"""rig.yaml: gear, limits, time-outs and devices of a rig; and what kind of rig one is."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from functools import cache, cached_property
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any

import yaml
from msgspec import Meta

from endoscope_core.choices import LOAD_CELL_DEVICES, MOTOR_DEVICES, TRACKER_DEVICES
from endoscope_core.errors import FileError
from endoscope_core.schema import load_yaml, one_of, parse_yaml, read, within

SHIPPED = Path(__file__).with_name('rig.yaml')
NAME = Meta(
    pattern=r'^[A-Za-z][A-Za-z0-9_]*\Z', description='a name of letters, digits and underscores'
)


@dataclass(frozen=True)
class JointFacts:
    """Facts common to all joints of the bending section; SI units."""

    gear: Annotated[float, within(0.01, 100.0)]  # shaft angle for one radian at the joint
    # Largest desired bending in rad, either way, whoever desires it: played motion, handle, program
    # or calibration, which is refused where its motion needs more.
    reach: Annotated[float, within(0.1, 3.1)]
    # Largest joint-equivalent motor angle in rad, either way; what compensation adds to the
    # desired bending has its place between the two.
    drive: Annotated[float, within(0.1, 10.0)]
    # Largest correction by feedback in rad, either way.
    correction: Annotated[float, within(0.0, 3.1)]
    # Largest of a desired angle, in rad/s and rad/s^2.
    speed: Annotated[float, within(0.01, 100.0)]
    acceleration: Annotated[float, within(0.1, 1e4)]
    # Largest speed in rad/s of a joint that follows the handle.
    hand_speed: Annotated[float, within(0.01, 20.0)]
    # Largest distance in rad from the measured pose to the first command of a stream.
    entry_step: Annotated[float, within(0.001, 1.0)]

    def entry(self, measured: Sequence[float]) -> tuple[float, ...]:
        """Where a stream of commands begins that comes from a measured pose (J,), in rad.

        That is there or, from beyond the reach, half an entry step nearer to it: nothing goes
        further out, and the command gate measures again, with noise of its own.
        """
        return tuple(
            math.copysign(min(abs(x), max(self.reach, abs(x) - 0.5 * self.entry_step)), x)
            for x in measured
        )


@dataclass(frozen=True)
class MotorFacts:
    """Facts common to all motor shafts; SI units."""

    reach: Annotated[float, within(0.01, 20.0)]  # largest shaft angle in rad, either way
    # Largest of a shaft, in rad/s and rad/s^2.
    speed: Annotated[float, within(0.01, 100.0)]
    acceleration: Annotated[float, within(0.1, 1e5)]
    # Largest distance in rad of two goals that follow each other.
    step: Annotated[float, within(1e-4, 1.0)]
    # Largest distance in rad from the measured position to the first command of a stream.
    entry_step: Annotated[float, within(0.001, 1.0)]
    resolution: Annotated[float, within(0.0, 0.1)]  # one count of their encoders in rad


@dataclass(frozen=True)
class Timeouts:
    """Longest permitted silences, in s."""

    # A command older than this is not obeyed, and a stream that pauses longer has ended.
    command: Annotated[float, within(0.001, 1.0)]
    # Silence of motors or load cells at which the slave goes to FAULT.
    stream: Annotated[float, within(0.005, 10.0)]
    # Silence of the handle after which it counts as released.
    handle: Annotated[float, within(0.01, 1.0)]

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

    ceiling: Annotated[float, within(0.1, 500.0)]  # at which the slave goes to FAULT
    calibration_ceiling: Annotated[float, within(0.1, 500.0)]  # at which a calibration is aborted


@dataclass(frozen=True)
class TipFacts:
    """Force on the tip across its axis, in N, and what is done about it."""

    force_limit: Annotated[float, within(0.001, 100.0)]  # above which the guard acts
    # Largest speed in m/s at which the tip goes on against a force above the limit.
    contact_speed: Annotated[float, within(1e-5, 1.0)]
    # And once nothing pushes, until it is where the hand has gone meanwhile.
    release_speed: Annotated[float, within(1e-5, 1.0)]
    force_alarm: Annotated[float, within(0.001, 100.0)]  # at which the console sounds an alarm


@dataclass(frozen=True)
class HandleFacts:
    """The operator's handle, in rad."""

    resolution: Annotated[float, within(0.0, 0.1)]  # one count of its encoders in rad


@dataclass(frozen=True)
class InstrumentFacts:
    """The instrument's end, in m."""

    section_length: Annotated[float, within(0.001, 0.5)]  # length of the bending section in m
    # Frame of its beginning, z along the straight instrument: that of all poses.
    base_frame: Annotated[str, NAME]


@dataclass(frozen=True)
class DeviceFacts:
    """Which devices are real and which are simulated."""

    # One of `MOTOR_DEVICES`, `LOAD_CELL_DEVICES` and `TRACKER_DEVICES`.
    motors: Annotated[str, one_of(MOTOR_DEVICES)]
    load_cells: Annotated[str, one_of(LOAD_CELL_DEVICES)]
    tracker: Annotated[str, one_of(TRACKER_DEVICES)]


@dataclass(frozen=True)
class SimulationFacts:
    """The simulated slave."""

    plant: str  # path of its plant.yaml; empty for the nominal plant
    seed: Annotated[int, within(0)]  # of the noise of its sensors


@dataclass(frozen=True)
class Rig:
    """A rig; see the classes of its parts.

    ValueError if `drive` is less than the reach of a joint, or times gear beyond that of a shaft.
    """

    joints: JointFacts
    motors: MotorFacts
    timeouts: Timeouts
    tension: TensionFacts
    tip: TipFacts
    handle: HandleFacts
    instrument: InstrumentFacts
    devices: DeviceFacts
    simulation: SimulationFacts

    def __post_init__(self) -> None:
        if self.joints.drive < self.joints.reach:
            raise ValueError(
                f'joints.drive {self.joints.drive:g} rad is less than joints.reach '
                f'{self.joints.reach:g} rad: the motors could not follow up to the reach'
            )
        if self.tip.release_speed < self.tip.contact_speed:
            raise ValueError(
                f'tip.release_speed {self.tip.release_speed:g} m/s is less than tip.contact_speed '
                f'{self.tip.contact_speed:g} m/s: the tip would be slower once nothing pushes'
            )
        shaft = self.joints.drive * self.joints.gear
        if shaft > self.motors.reach:
            raise ValueError(
                f'joints.drive times gear is {shaft:g} rad of the shaft, beyond motors.reach '
                f'{self.motors.reach:g}'
            )


def load_rig(path: str | Path | None = None) -> Rig:
    """Read a rig.yaml; missing keys take the values of the shipped one, which is the default.

    FileError if it cannot be read, has an unknown key, or a value out of range.
    """
    if path is None or not str(path):
        return _rig({}, 'the shipped rig')
    rig = _rig(load_yaml(path), f'rig file {path}')
    if not rig.simulation.plant:
        return rig
    plant = Path(path).parent / rig.simulation.plant
    return replace(rig, simulation=replace(rig.simulation, plant=str(plant)))


def rig_as_text(rig: Rig) -> str:
    """All facts of a rig as YAML, for a recording of it."""
    return yaml.safe_dump(asdict(rig), sort_keys=False)


def rig_from_text(text: str, name: str) -> Rig:
    """Read what `rig_as_text` wrote; `name` is its place in error messages.

    FileError if it has an unknown key, or a value out of range.
    """
    return _rig(parse_yaml(text, name), name)


@cache
def shipped_rig() -> Rig:
    """The rig that comes with the project."""
    return load_rig()


def _rig(own: Any, where: str) -> Rig:
    return read(Rig, _over(load_yaml(SHIPPED), own), where)


def _over(shipped: Mapping[str, Any], own: Any) -> Any:
    """The values of a file, completed with those of the shipped one."""
    if not isinstance(own, Mapping):
        return own
    parts = {
        key: _over(part, {} if own.get(key) is None else own[key])
        for key, part in shipped.items()
        if isinstance(part, Mapping)
    }
    return {**shipped, **own, **parts}


class Kind(StrEnum):
    """Kind of a rig, by its motors; of several in a recording the first listed here counts."""

    SIMULATED = 'simulated'  # the plant of this project moves
    EMULATED = 'emulated'  # servos that this project emulates answer the driver
    UNKNOWN = 'unknown'  # not recorded
    REAL = 'real'


@dataclass(frozen=True)
class RigKind:
    """Kind and identification of a rig; empty where not recorded."""

    kind: Kind = Kind.UNKNOWN
    program: str = ''  # name and version of the program that drove or simulated it
    rig_sha256: str = ''  # of the facts of its rig.yaml, as `rig_as_text` writes them
    plant: str = ''  # file name of the plant that was simulated, or `nominal`
    plant_sha256: str = ''  # of that plant, as `save_plant` writes it

    def as_text(self) -> str:
        """Return it as YAML, as it stands on the topic; what is empty is left out."""
        known = {name: str(value) for name, value in asdict(self).items() if value}
        return yaml.safe_dump(known, sort_keys=False)

    def as_json(self) -> dict[str, str]:
        """Return it as plain data."""
        return {name: str(value) for name, value in asdict(self).items()}

    def __str__(self) -> str:
        known = [
            self.program,
            f'rig {self.rig_sha256[:12]}' if self.rig_sha256 else '',
            ' '.join(['plant', *filter(None, (self.plant, self.plant_sha256[:12]))])
            if self.plant_sha256
            else '',
        ]
        details = ', '.join(filter(None, known))
        return f'{self.kind} ({details})' if details else str(self.kind)


def digest(text: str) -> str:
    """SHA-256 of a rig or a plant as text, in hexadecimal digits."""
    return sha256(text.encode()).hexdigest()


def kind_from_text(text: str) -> RigKind:
    """Read what `RigKind.as_text` wrote; any other text is of an unknown kind."""
    try:
        document = parse_yaml(text, 'kind of the rig')
    except FileError:
        # A foreign recording: other content of this topic does not make the rig a real one.
        return RigKind()
    if not isinstance(document, Mapping) or document.get('kind') not in list(Kind):
        return RigKind()
    words: dict[str, Any] = {
        name: str(document.get(name, '')) for name in RigKind.__dataclass_fields__ if name != 'kind'
    }
    return RigKind(Kind(document['kind']), **words)


def kind_of_several(kinds: list[RigKind]) -> RigKind:
    """Return the kind of a recording that carries several: real only if all of them are."""
    return min(kinds, key=lambda one: list(Kind).index(one.kind), default=RigKind())
