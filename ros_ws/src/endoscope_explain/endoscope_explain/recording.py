"""A recording as analysis sees it: time series by joint, their names, and how a bag becomes one."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_bags.errors import BagError
from endoscope_bags.information import counted_losses
from endoscope_bags.joint_state_series import JointStateSeries
from endoscope_bags.recording import Recording, kind_of_bag, open_bag, rig_of_bag
from endoscope_bags.sequence_gaps import SequenceGaps
from endoscope_core.choices import WAIVABLE
from endoscope_core.physics.description import PlantDescription
from endoscope_core.rig import Rig, RigKind, shipped_rig

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

COMMAND = 'motor/servo_jp'
SETPOINT = 'motor/setpoint_js'
MOTOR = 'motor/measured_js'
WIRES = 'wires/measured_js'
BENDING = 'slave/measured_js'
DESIRED = 'slave/servo_jp'
INPUT_TOPICS = (SETPOINT, COMMAND, DESIRED)
"""The nearest to the shafts first.

A setpoint shows what the motor driver made of commands: which it obeyed, how it bounded them, and
the pose that it held once they had ended.
"""


LEAST_DURATION_S = 2.0
"""Length of a recording, or of what is left of it, from which on it can be explained."""
MOVES_RAD = 0.01
"""Shaft angle that is a motion."""


@dataclass(frozen=True)
class Series:
    """Samples of one quantity."""

    topic: str  # topic without namespace that it comes from
    time: Array  # (N,), header stamps in s from the recording's first stamp
    # (N, J), one column for each joint, or for tensions (N, J, 2): positive and negative wire.
    values: Array
    valid: Mask  # false where a sample must not be judged: absent, frozen, clipped or wrong
    # (N,), when each sample was received, by the recorder's clock, in s from the recording's first
    # stamp.
    received: Array | None = None
    # (N,), messages that were published and not recorded directly before each sample; None where
    # the recorder does not count them.
    lost: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        if len(self.time) != len(self.values) or self.valid.shape != self.values.shape:
            raise ValueError(f'{self.topic}: time, values and valid differ in length')

    @staticmethod
    def of(topic: str, time: Array, values: Array, received: Array | None = None) -> 'Series':
        """All samples valid where they are finite."""
        return Series(topic, time, values, np.isfinite(values), received)

    def taken(self, index: NDArray[np.intp] | Mask) -> 'Series':
        """Return the samples of an index array, in its order."""
        return replace(
            self,
            time=self.time[index],
            values=self.values[index],
            valid=self.valid[index],
            received=None if self.received is None else self.received[index],
            lost=None if self.lost is None else self.lost[index],
        )

    def without(self, wrong: Mask) -> 'Series':
        """Return the same samples, with those that are `wrong` no longer valid."""
        return replace(self, valid=self.valid & ~wrong)


@dataclass(frozen=True)
class Restart:
    """Where another recording of the same rig begins within one that was made of several."""

    time: float  # of its first command, s
    # (J, K), as `RigRecording.start`, the motors' way since the recording before; none where the
    # rig goes on as it was left.
    way: Array
    speed: Array  # (J,), as `RigRecording.start_speed`


@dataclass(frozen=True)
class RigRecording:
    """What was commanded and measured."""

    name: str  # what to call it in messages
    origin: float  # first stamp of all, in s of the recording's clock
    joints: tuple[str, ...]  # joints in the order of every series' columns
    command: Series  # motor shaft command in rad, each in force from its stamp until the next one
    # Load cells in N, values (N, J, 2): positive, negative wire; None on a rig without them.
    tension: Series | None
    bending: Series  # bending angle in rad from the tracker
    # Motor shaft in rad, rad/s, N m; None where not recorded.
    shaft_position: Series | None = None
    shaft_velocity: Series | None = None
    shaft_effort: Series | None = None
    # What is missing or was taken from elsewhere, in words.
    notes: tuple[str, ...] = field(default=())
    # (J, K), shaft angles in rad to which each motor had gone, one after the other, when the
    # recording began; the first command alone where None.
    start: Array | None = None
    start_speed: Array | None = None  # (J,), speed of each motor then, rad/s; they stood where None
    restarts: tuple[Restart, ...] = ()  # of the recordings after the first one; see `takes`
    rig: Rig = field(default_factory=shipped_rig)  # gear, limits and time-outs of what was recorded
    rig_kind: RigKind = field(default_factory=RigKind)  # what the recording states that it is of

    def measured(self) -> dict[str, Series]:
        """Return the recorded measured series by their name in this class."""
        return {name: s for name in QUANTITY_TOPICS if (s := getattr(self, name)) is not None}

    def with_series(self, changed: Mapping[str, Series]) -> 'RigRecording':
        """Return the same recording with some series, by name, replaced."""
        fields: dict[str, Any] = dict(changed)
        return replace(self, **fields)

    @property
    def gear(self) -> float:
        """Angle of a motor's shaft for one radian of desired bending."""
        return self.rig.joints.gear

    @property
    def duration(self) -> float:
        """Seconds from the first stamp to the last one of any series."""
        last = [self.command.time[-1], *(s.time[-1] for s in self.measured().values())]
        return float(max(last))


def input_topic(bag: Recording, namespace: str | None = None) -> str:
    """The plant's input, the nearest to the shafts that was recorded; empty where none was."""
    return next((topic for topic in INPUT_TOPICS if bag.has(topic, namespace)), '')


QUANTITY_TOPICS = {
    'shaft_position': MOTOR,
    'shaft_velocity': MOTOR,
    'shaft_effort': MOTOR,
    'tension': WIRES,
    'bending': BENDING,
}
"""Topic of each measured series of a `RigRecording`."""

QUANTITY_UNITS = {
    'shaft_position': 'rad',
    'shaft_velocity': 'rad/s',
    'shaft_effort': 'N m',
    'tension': 'N',
    'bending': 'rad',
}


def axis(joint: str) -> str:
    """Return the letter of a joint: `x` of `bend_x`."""
    return joint.rpartition('_')[2]


def wire_names(joint: str) -> tuple[str, str]:
    """Return the names of the positive and the negative wire of a joint."""
    return f'wire_{axis(joint)}_pos', f'wire_{axis(joint)}_neg'


def motor_name(joint: str) -> str:
    """Return the name of a joint's motor."""
    return f'motor_{axis(joint)}'


def signal_name(quantity: str, joint: str, wire: int = 0) -> str:
    """The name of one column of a series, for example `wires/measured_js:wire_x_pos`."""
    # The three quantities of the motor share a topic and differ by a suffix:
    # `motor/measured_js:motor_x.position`.
    topic = QUANTITY_TOPICS[quantity]
    if quantity == 'tension':
        return f'{topic}:{wire_names(joint)[wire]}'
    if quantity == 'bending':
        return f'{topic}:{joint}'
    return f'{topic}:{motor_name(joint)}.{quantity.removeprefix("shaft_")}'


STRAY_NS = 10_000_000_000
"""Further from its receipt than the others of its topic by this, a stamp is no delay."""


def without_stray(series: JointStateSeries) -> tuple[JointStateSeries, list[str]]:
    """Leave out messages stamped far from their receipt, unlike the others, with a note of it."""
    delay = series.log_ns - series.stamp_ns
    far = np.abs(delay - np.median(delay)) > STRAY_NS
    # Where most are far, the clock runs at another rate, or counts in another unit: see the audit.
    few = far.any() and np.count_nonzero(far) < 0.5 * len(far)
    if not few or np.ptp(series.stamp_ns) <= np.ptp(series.log_ns) + STRAY_NS:
        return series, []
    seconds = int(series.stamp_ns[far][0]) * 1e-9
    note = (
        f'{int(far.sum())} of {len(series)} messages of {series.topic} are left out: their stamps '
        f'are far from when they were received (the first is stamped {seconds:.3f} s)'
    )
    return series.ordered(np.flatnonzero(~far)), [note]


def require_running_stamps(path: object, series: JointStateSeries) -> None:
    """Raise BagError where several messages of a topic all have one stamp."""
    if len(series) > 1 and np.ptp(series.stamp_ns) == 0:
        raise BagError(
            f'{path}: all {len(series)} messages of {series.topic} are stamped '
            f'{int(series.stamp_ns[0]) * 1e-9:.3f} s: its driver must set the header'
        )


def require_common_time(path: object, topics: Sequence[JointStateSeries]) -> None:
    """Refuse topics without running stamps, or time in common with the first: the commands."""
    for one in topics:
        require_running_stamps(path, one)
    commands = topics[0]
    origin = int(commands.stamp_ns.min())
    for one in topics[1:]:
        begin, end = int(one.stamp_ns.min()), int(one.stamp_ns.max())
        if begin > commands.stamp_ns.max() or end < origin:
            raise BagError(
                f'{path}: {one.topic} is stamped from {(begin - origin) * 1e-9:.3f} to '
                f'{(end - origin) * 1e-9:.3f} s after the first command of {commands.topic}, the '
                f'last of which is at {int(np.ptp(commands.stamp_ns)) * 1e-9:.3f} s: record both '
                'by one clock'
            )


OPTIONAL = (WIRES,)
"""Those of `WAIVABLE` that many rigs do not have: nobody has to waive them."""


def recording_from_bag(
    path: str | Path,
    plant: PlantDescription,
    *,
    without: Collection[str] = (),
    namespace: str | None = None,
    rig: Rig | None = None,
) -> RigRecording:
    """What analysis needs of a bag, in the order in which it was recorded; BagError if unusable."""
    # It has the joints of the plant that all topics have, and notes of what is missing. Topics of
    # `without`, some of `WAIVABLE`, may be missing.
    bag = open_bag(path)
    rig = rig or rig_of_bag(bag)
    lacking = [t for t in (WIRES, BENDING, MOTOR) if not bag.has(t, namespace)]
    commanded = input_topic(bag, namespace)
    lacking += [] if commanded else [COMMAND]
    fatal = [t for t in lacking if t not in without and t not in OPTIONAL]
    if fatal:
        raise BagError(_lacking_message(bag, fatal, namespace))
    notes = [f'{t} was not recorded' for t in lacking]

    def read(topic: str, quantity: str) -> JointStateSeries:
        series = bag.joint_state(topic, namespace=namespace, order='recorded', finite=(quantity,))
        if len(series) < 2:
            raise BagError(f'{path}: topic {series.topic} holds {len(series)} message')
        series.require(quantity)
        series, left_out = without_stray(series)
        notes.extend(left_out)
        return series

    def names_of(topic: str, joint: str) -> tuple[str, ...]:
        if topic == WIRES:
            return wire_names(joint)
        return (joint if topic in (BENDING, DESIRED) else motor_name(joint),)

    recorded = {commanded: read(commanded, 'position')}
    if commanded == DESIRED:
        notes.append(
            f'{COMMAND} was not recorded: {DESIRED} times the gear, {rig.joints.gear:g}, is taken '
            'for it'
        )
    for topic in (BENDING, *(t for t in (WIRES, MOTOR) if t not in lacking)):
        recorded[topic] = read(topic, 'effort' if topic == WIRES else 'position')

    joints = []
    for joint in plant.joints:
        absent = [
            f'{one.topic} has no {name}'
            for topic, one in recorded.items()
            for name in names_of(topic, joint)
            if name not in one.names
        ]
        if absent:
            notes.append(f'{joint} is left out: ' + ', '.join(absent))
        else:
            joints.append(joint)
    if not joints:
        raise BagError(f'{path}: no joint is complete: ' + '; '.join(notes))

    every = [recorded[t] for t in (commanded, WIRES, BENDING, MOTOR) if t in recorded]
    require_common_time(path, every)
    counted = counted_losses(bag)
    origin_ns = min(int(s.stamp_ns.min()) for s in every)

    def series(topic: str, key: str) -> Series:
        source = recorded[topic]
        chosen = source.select([name for joint in joints for name in names_of(topic, joint)])
        values = chosen.require(key)
        time = np.asarray((chosen.stamp_ns - origin_ns) * 1e-9, dtype=np.float64)
        if topic == WIRES:
            values = values.reshape(len(values), len(joints), 2)
        received = np.asarray((chosen.log_ns - origin_ns) * 1e-9, dtype=np.float64)
        lost = None
        if source.topic in counted:
            gaps = SequenceGaps()
            lost = np.array([gaps.add(n) for n in source.sequence.tolist()], dtype=np.int64)
        made = Series.of(topic, time, np.ascontiguousarray(values), received)
        return replace(made, lost=lost)

    shaft = series(commanded, 'position')
    if commanded == DESIRED:
        shaft = replace(shaft, values=shaft.values * rig.joints.gear)
    motors = dict[str, Series | None].fromkeys(('position', 'velocity', 'effort'))
    for key in motors if MOTOR in recorded else ():
        if getattr(recorded[MOTOR], key) is None:
            notes.append(f'{MOTOR} has no {key}')
            continue
        recorded[MOTOR].check_finite([key])
        motors[key] = series(MOTOR, key)
    return RigRecording(
        name=Path(path).name.removesuffix('.mcap'),
        origin=origin_ns * 1e-9,
        joints=tuple(joints),
        command=shaft,
        tension=series(WIRES, 'effort') if WIRES in recorded else None,
        bending=series(BENDING, 'position'),
        shaft_position=motors['position'],
        shaft_velocity=motors['velocity'],
        shaft_effort=motors['effort'],
        notes=tuple(notes),
        rig=rig,
        rig_kind=kind_of_bag(bag),
    )


def with_unrecorded(plant: PlantDescription, described: PlantDescription) -> PlantDescription:
    """Return a plant of the recorded joints with the others as they are described."""
    return replace(
        plant,
        joints={name: plant.joints.get(name, joint) for name, joint in described.joints.items()},
        effects=plant.effects + tuple(e for e in described.effects if e.joint not in plant.joints),
        terms=plant.terms + tuple(t for t in described.terms if t.joint not in plant.joints),
    )


def _lacking_message(bag: Recording, topics: Sequence[str], namespace: str | None) -> str:
    text = bag.lacking(*topics, namespace=namespace)
    waivable = [t for t in topics if t in WAIVABLE]
    if waivable and len(waivable) == len(topics):
        text += f'; to explain it without them, give --without {waivable[0]}'
    return text
