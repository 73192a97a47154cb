"""Recordings as episodes: all channels at the frames of one rate, for data sets of robot learning.

A command is in force from its stamp until the next one. What was measured is taken between the
readings on both sides of a frame; where one of its topics is silent there is no frame, and the
recording falls into several episodes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from endoscope_bags.errors import BagError
from endoscope_bags.information import SILENT_PERIODS
from endoscope_bags.message_types import WRENCH_STAMPED
from endoscope_bags.recording import Recording

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

STATE = 'observation.state'
LEAST_S = 1.0
"""Length from which on a stretch without a silence is an episode."""


@dataclass(frozen=True)
class Source:
    """Where a feature of a data set comes from."""

    feature: str  # its name there
    topic: str  # without namespace
    quantity: str  # `position` or `effort` of a JointState, `force` of a WrenchStamped
    unit: str
    held: bool = False  # whether a value is in force until the next one: a command


ACTIONS = (
    Source('action', 'slave/servo_jp', 'position', 'rad', held=True),
    Source('action', 'motor/servo_jp', 'position', 'rad', held=True),
)
"""What the instrument was asked for; the first that was recorded."""
OBSERVATIONS = (
    Source(STATE, 'slave/measured_js', 'position', 'rad'),
    Source('observation.meta.motor_command', 'motor/servo_jp', 'position', 'rad', held=True),
    Source('observation.meta.motor_position', 'motor/measured_js', 'position', 'rad'),
    Source('observation.meta.motor_effort', 'motor/measured_js', 'effort', 'N m'),
    Source('observation.meta.wire_tension', 'wires/measured_js', 'effort', 'N'),
    Source('observation.meta.tip_force', 'slave/body/measured_cf', 'force', 'N'),
)


@dataclass(frozen=True)
class Channel:
    """All samples of one feature."""

    source: Source
    names: tuple[str, ...]
    stamp_ns: IntArray  # (N,), rising
    value: FloatArray  # (N, J)

    @property
    def period_ns(self) -> float:
        """Usual interval between samples."""
        return float(np.median(np.diff(self.stamp_ns)))

    def covers(self, frame_ns: IntArray) -> npt.NDArray[np.bool_]:
        """Whether the channel has a value at frames (F,): no silence there."""
        before = np.searchsorted(self.stamp_ns, frame_ns, side='right') - 1
        if self.source.held:
            return before >= 0
        after = np.searchsorted(self.stamp_ns, frame_ns, side='left')
        inside = (before >= 0) & (after < len(self.stamp_ns))
        ends = np.clip([before, after], 0, len(self.stamp_ns) - 1)
        left, right = self.stamp_ns[ends]
        return np.asarray(inside & (right - left <= SILENT_PERIODS * self.period_ns))

    def at(self, frame_ns: IntArray) -> FloatArray:
        """Values (F, J) at frames (F,) that the channel covers."""
        if self.source.held:
            return self.value[np.searchsorted(self.stamp_ns, frame_ns, side='right') - 1]
        origin = self.stamp_ns[0]
        own, asked = (self.stamp_ns - origin) * 1e-9, (frame_ns - origin) * 1e-9
        return np.stack([np.interp(asked, own, column) for column in self.value.T], axis=1)


@dataclass(frozen=True)
class Channels:
    """The channels of a recording."""

    name: str  # of the recording
    channels: tuple[Channel, ...]
    lacking: dict[str, str]  # features that it does not have, with the reason

    @property
    def tracker_rate(self) -> int:
        """Rate in Hz of the bending angle; BagError where it has none of one Hz or more."""
        state = [c for c in self.channels if c.source.feature == STATE]
        rate = round(1e9 / state[0].period_ns) if state else 0
        if not rate:
            raise BagError(f'{self.name}: no rate of the tracker to take over: give --fps')
        return rate


@dataclass(frozen=True)
class Episode:
    """F frames at an even rate."""

    recording: str
    start_ns: int  # stamp of the first frame, ns since the epoch
    values: dict[str, npt.NDArray[np.float32]]  # (F, J) by feature

    def __len__(self) -> int:
        return len(next(iter(self.values.values())))


def channels_of(bag: Recording, namespace: str | None = None) -> Channels:
    """Channels of a recording; BagError without a command, or for what is not finite."""
    asked = [s for s in ACTIONS if bag.has(s.topic, namespace)]
    if not asked:
        raise BagError(bag.lacking(*(s.topic for s in ACTIONS), namespace=namespace))
    channels: list[Channel] = []
    lacking: dict[str, str] = {}
    for source in (asked[0], *OBSERVATIONS):
        if not bag.has(source.topic, namespace):
            lacking[source.feature] = f'{source.topic} was not recorded'
        elif (found := _channel(bag, source, namespace)) is None:
            lacking[source.feature] = f'{source.topic} has no {source.quantity}'
        elif len(found.stamp_ns) < 2 and not source.held:
            lacking[source.feature] = f'{source.topic} has one message'
        else:
            channels.append(found)
    if channels[:1] and channels[0].source.feature != 'action':
        raise BagError(f'{bag.path}: {asked[0].topic} has no {asked[0].quantity}')
    return Channels(bag.path.name.removesuffix('.mcap'), tuple(channels), lacking)


def _channel(bag: Recording, source: Source, namespace: str | None) -> Channel | None:
    if source.quantity == 'force':
        names, stamps, values = _forces(bag, bag.find(source.topic, namespace))
    else:
        series = bag.joint_state(source.topic, namespace=namespace, finite=(source.quantity,))
        found = getattr(series, source.quantity)
        if found is None:
            return None
        names, stamps, values = series.names, series.stamp_ns, found
    # Of several samples with one stamp the last is in force.
    last = np.append(np.diff(stamps) > 0, True)
    return Channel(source, names, stamps[last], values[last])


def _forces(bag: Recording, topic: str) -> tuple[tuple[str, ...], IntArray, FloatArray]:
    if bag.topics[topic].type != WRENCH_STAMPED:
        raise BagError(
            f'{bag.path}: topic {topic} is {bag.topics[topic].type}, not {WRENCH_STAMPED}'
        )
    rows = [
        (m.header.stamp.sec * 10**9 + m.header.stamp.nanosec, m.wrench.force)
        for _, m in bag.decoded(topic)
    ]
    stamps = np.array([stamp for stamp, _ in rows], dtype=np.int64)
    values = np.array([(f.x, f.y, f.z) for _, f in rows], dtype=np.float64)
    # A component that is never a number was not measured, as the one along the tip's axis.
    known = np.flatnonzero(~np.isnan(values).all(axis=0))
    values = values[:, known]
    if not (len(known) and np.isfinite(values).all()):
        raise BagError(f'{bag.path}: topic {topic} has forces that are not finite')
    order = np.argsort(stamps, kind='stable')
    return tuple(f'force_{"xyz"[k]}' for k in known), stamps[order], values[order]


def episodes_of(recorded: Channels, fps: int) -> list[Episode]:
    """Episodes at `fps` frames a second; BagError where no second has all channels."""
    measured = [c for c in recorded.channels if not c.source.held]
    first = max(int(c.stamp_ns[0]) for c in recorded.channels)
    last = min((int(c.stamp_ns[-1]) for c in measured), default=0)
    if not measured:
        last = max(int(c.stamp_ns[-1]) for c in recorded.channels)
    # Frames fall on the tracker's stamps where their rates are the same.
    state = next((c for c in measured if c.source.feature == STATE), None)
    if state is not None:
        first = int(state.stamp_ns[state.stamp_ns >= min(first, last)][0])
    count = (last - first) * fps // 10**9 + 1
    frame_ns = first + np.round(np.arange(max(count, 0)) * (1e9 / fps)).astype(np.int64)
    covered = np.logical_and.reduce([c.covers(frame_ns) for c in recorded.channels])
    edges = np.flatnonzero(np.diff(np.concatenate(([0], covered.astype(np.int8), [0]))))
    found = [
        Episode(
            recorded.name,
            int(frame_ns[begin]),
            {
                c.source.feature: c.at(frame_ns[begin:end]).astype(np.float32)
                for c in recorded.channels
            },
        )
        for begin, end in edges.reshape(-1, 2)
        if end - begin >= LEAST_S * fps
    ]
    if not found:
        raise BagError(
            f'{recorded.name}: no {LEAST_S:g} s in which none of '
            f'{", ".join(dict.fromkeys(c.source.topic for c in recorded.channels))} is silent'
        )
    return found


def refuse_other_channels(recordings: Sequence[Channels]) -> None:
    """BagError if recordings of one data set differ in their channels."""

    def columns(one: Channels) -> dict[str, tuple[str, ...]]:
        return {c.source.feature: (c.source.topic, *c.names) for c in one.channels}

    for other in recordings[1:]:
        before, here = columns(recordings[0]), columns(other)
        for feature in before | here:
            if before.get(feature) != here.get(feature):
                raise BagError(
                    f'{other.name} and {recordings[0].name} differ in {feature}: '
                    'make a data set of each'
                )
