"""Pictures of the slave: every sample that came, as ranges and two lines, thirty times a second."""

import math
from collections import deque
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rclpy.node import Node
from sensor_msgs.msg import JointState

from endoscope_bags.errors import MalformedMessageError
from endoscope_console.teleop.frames import POINTS, encode_telemetry
from endoscope_core.kinematics import centre_line
from endoscope_nodes.names import (
    BOUNDS,
    JOINTS,
    MOTOR_COMMAND,
    MOTOR_MEASURED,
    MOTORS,
    SLAVE_COMMAND,
    SLAVE_MEASURED,
    TIP_FORCE_BOUNDS,
    WIRES,
    WIRES_MEASURED,
)
from endoscope_nodes.runtime.qos import profile
from endoscope_nodes.runtime.streams import JointReader, JointSample, RawSubscription
from endoscope_nodes.topics import Qos

_STREAMS = (
    (SLAVE_COMMAND, JOINTS, 'wanted', 'rad'),
    (SLAVE_MEASURED, JOINTS, 'measured', 'rad'),
    (MOTOR_COMMAND, MOTORS, 'wanted', 'rad'),
    (MOTOR_MEASURED, MOTORS, 'measured', 'rad'),
    (WIRES_MEASURED, WIRES, 'tension', 'N'),
    (TIP_FORCE_BOUNDS, BOUNDS, 'at the tip', 'N'),
)
# No topic: a force is 0.1 s late, and with it come the angles of its own time.
_OF_FORCE = ('tip_force/angles', JOINTS, 'where the force is', 'rad')
SIGNALS = tuple(
    {
        'name': f'{topic}:{name}',
        'label': f'{name.replace("_", " ")}, {label}',
        'unit': '' if name == BOUNDS[-1] else unit,
    }
    for topic, names, label, unit in (*_STREAMS, _OF_FORCE)
    for name in names
)
"""What the ranges of a picture are of, in their order."""
# At 1 kHz the queue holds what comes while this process is not run for six pictures.
_QUEUE = profile(Qos(200, reliable=False))
_FRESH_NS = 150_000_000
_TRACKED_NS = 500_000_000
_REMEMBERED = 16
_NOTHING = np.full((POINTS, 3), np.nan)


class Envelope:
    """Smallest, largest and last value of N signals, so that no peak between pictures is lost."""

    def __init__(self, count: int) -> None:
        self._ranges = np.full((count, 3), np.nan)

    def take(self, k: int, values: ArrayLike) -> None:
        """Take samples (M,) of signal `k` in its own unit, in their order, without those NaN."""
        samples = np.asarray(values, dtype=float)
        samples = samples[~np.isnan(samples)]
        if not samples.size:
            return
        low, high, _ = self._ranges[k]
        self._ranges[k] = (
            np.fmin(low, samples.min()),
            np.fmax(high, samples.max()),
            samples[-1],
        )

    def close(self) -> NDArray[np.float64]:
        """End the interval and begin the next: (N, 3), NaN where no sample came."""
        ranges, self._ranges = self._ranges, np.full_like(self._ranges, np.nan)
        return ranges


class Stream:
    """A topic of J joints, motors or wires, whose waiting samples are taken all at once."""

    def __init__(self, node: Node, topic: str, names: tuple[str, ...]) -> None:
        self._reader = JointReader(names)
        self._subscription = RawSubscription(node, JointState, topic, _QUEUE)
        self._of_effort = names in (WIRES, BOUNDS)
        self.recent: deque[JointSample] = deque(maxlen=_REMEMBERED)  # the newest samples
        self.heard_ns = 0  # when it came, by this machine's clock
        self.malformed = 0

    def take(self) -> list[tuple[float, ...]]:
        """Return the values of the samples that wait, each of shape (J,): rad, of efforts N."""
        values = []
        for data, info in self._subscription.take():
            try:
                sample = self._reader.read(data)
            except MalformedMessageError:
                self.malformed += 1
                continue
            of = sample.effort if self._of_effort else sample.position
            if of:
                values.append(of)
                self.recent.append(sample)
                self.heard_ns = info['received_timestamp']
        return values

    @property
    def last(self) -> JointSample | None:
        """The newest sample; None before the first."""
        return self.recent[-1] if self.recent else None

    def position_at(self, stamp_ns: int) -> list[float]:
        """Angles (J,) in rad between the samples around a stamp; NaN where it lies outside."""
        stamps = [sample.stamp_ns - stamp_ns for sample in self.recent]
        columns = zip(*(sample.position for sample in self.recent), strict=True)
        return [float(np.interp(0, stamps, c, math.nan, math.nan)) for c in columns]

    def position(self, now_ns: int, lasts_ns: int) -> tuple[float, ...] | None:
        """The newest angles in rad, shape (J,); None where they came longer ago than they last."""
        if self.last is None or now_ns - self.heard_ns > lasts_ns:
            return None
        return self.last.position

    def close(self) -> None:
        """Leave the topic."""
        self._subscription.close()


def _push(bounds: tuple[float, ...]) -> float:
    x, y, *_, seen = bounds
    return float(np.hypot(*np.nan_to_num((x, y)))) if seen == 1.0 else 0.0


class Pictures:
    """Takes what waits on all streams and makes a picture of it, for a section of `length` m."""

    def __init__(self, node: Node, length: float) -> None:
        self._length = length
        self._streams = [Stream(node, topic, names) for topic, names, _, _ in _STREAMS]
        self._envelope = Envelope(len(SIGNALS))
        self.seq = 0  # number of the newest picture
        # (N, 2), the last pictures by number and steady time in ns.
        self.made: tuple[tuple[int, int], ...] = ()
        self.tensions: tuple[float, ...] = ()  # (4,), newest in N; empty before the first
        # (J,), asked of the slave by the master, in rad.
        self.wanted: tuple[float, ...] | None = None
        self.wanted_ns = 0  # when they were found here, by a steady clock
        # The compensator puts out commands for the motors: what is wanted is obeyed.
        self.drives = False
        self.tracked_age_s = math.inf  # since the tracker was heard; infinite before
        # Largest force in N of what is seen to touch the tip, in the newest picture; 0 for none.
        self.push = 0.0
        self.force_age_s = math.inf  # since a force was heard; infinite before

    def make(self, now_ns: int, wall_ns: int) -> bytes:
        """Make one of all that has come since the last; now in ns, `now_ns` by a steady clock."""
        command, measured, motors, _, wires, forces = self._streams
        self.push = 0.0
        for signal, stream in self._of_signals():
            values = stream.take()
            if values:
                columns: NDArray[np.float64] = np.array(values, dtype=float).T
                for k, column in enumerate(columns):
                    self._envelope.take(signal + k, column)
            if stream is forces and stream.last is not None and values:
                self.push = max(map(_push, values))
                for k, angle in enumerate(measured.position_at(stream.last.stamp_ns)):
                    self._envelope.take(signal + len(BOUNDS) + k, [angle])
        self.drives = motors.position(wall_ns, _FRESH_NS) is not None
        self.wanted = command.position(wall_ns, _FRESH_NS)
        if self.wanted is not None:
            self.wanted_ns = now_ns - max(0, wall_ns - command.heard_ns)
        if wires.last is not None:
            self.tensions = wires.last.effort
        if measured.last is not None:
            self.tracked_age_s = (wall_ns - measured.heard_ns) * 1e-9
        if forces.last is not None:
            self.force_age_s = (wall_ns - forces.heard_ns) * 1e-9
        # A force has the stamp of what it is from.
        newest = max(self._streams[:-1], key=lambda stream: stream.heard_ns)
        stamp_s = newest.last.stamp_ns * 1e-9 if newest.last is not None else math.nan
        age_s = max(0, wall_ns - newest.heard_ns) * 1e-9 if newest.last is not None else math.nan
        self.seq += 1
        # It stands here before anybody is sent it: who says that he saw it is believed.
        self.made = (*self.made[1 - _REMEMBERED :], (self.seq, now_ns))
        return encode_telemetry(
            self.seq,
            stamp_s,
            age_s,
            self._envelope.close(),
            self._line(self.wanted),
            self._line(measured.position(wall_ns, _TRACKED_NS)),
        )

    def _of_signals(self) -> Iterator[tuple[int, Stream]]:
        signal = 0
        for stream, (_, names, _, _) in zip(self._streams, _STREAMS, strict=True):
            yield signal, stream
            signal += len(names)

    def _line(self, bending: tuple[float, ...] | None) -> NDArray[np.float64]:
        if bending is None or not all(map(math.isfinite, bending)):
            return _NOTHING
        return centre_line(bending, self._length, POINTS)

    @property
    def malformed(self) -> int:
        """Messages that were no joint states."""
        return sum(stream.malformed for stream in self._streams)

    def close(self) -> None:
        """Leave all topics."""
        for stream in self._streams:
            stream.close()
