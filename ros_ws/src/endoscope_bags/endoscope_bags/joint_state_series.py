"""All messages of one topic as arrays."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from endoscope_bags.cdr import (
    QUANTITIES,
    Layout,
    LayoutGroup,
    Payloads,
    grouped_by_layout,
    joint_state_layout,
    pose_layout,
)
from endoscope_bags.errors import BagError, MalformedMessageError

MOST_JOINTS = 1024
"""Names on a topic; an instrument has ten, a robot a hundred."""
# Cells of the decoded arrays that any recording may have. Beyond that there must not be more than
# bytes: a joint takes 13 of a message that has it, its name and one number at least.
_FREE_CELLS = 1 << 20

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class JointStateSeries:
    """N messages of `sensor_msgs/msg/JointState` with J joints.

    Times are int64 in ns since the epoch; quantities are (N, J) in rad, rad/s and N m (N for
    wires), None where no message has them, NaN where some lack them.
    """

    topic: str  # full name
    names: tuple[str, ...]  # of joints, in the order in which they first appear
    # Header stamp, receipt and publication, (N,).
    stamp_ns: IntArray
    log_ns: IntArray
    publish_ns: IntArray
    sequence: IntArray  # (N,), the writer's message counter
    position: FloatArray | None
    velocity: FloatArray | None
    effort: FloatArray | None

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def seconds(self, origin_ns: int | None = None) -> FloatArray:
        """Return the stamps in seconds since `origin_ns` (default: the first stamp), shape (N,)."""
        if not len(self):
            return np.empty(0)
        origin = int(self.stamp_ns[0]) if origin_ns is None else origin_ns
        elapsed: FloatArray = (self.stamp_ns - origin) * np.float64(1e-9)
        return elapsed

    def ordered(self, index: npt.NDArray[np.int64]) -> 'JointStateSeries':
        """Return the messages `index` (any index array), in its order."""
        return replace(
            self,
            stamp_ns=self.stamp_ns[index],
            log_ns=self.log_ns[index],
            publish_ns=self.publish_ns[index],
            sequence=self.sequence[index],
            position=None if self.position is None else self.position[index],
            velocity=None if self.velocity is None else self.velocity[index],
            effort=None if self.effort is None else self.effort[index],
        )

    def select(self, names: Sequence[str]) -> 'JointStateSeries':
        """The series with the joints `names` only, in that order; BagError if one is not there."""
        missing = [name for name in names if name not in self.names]
        if missing:
            raise BagError(
                f'topic {self.topic} has no joint {", ".join(missing)}; '
                f'it has {", ".join(self.names) or "none"}'
            )
        columns = [self.names.index(name) for name in names]
        return replace(
            self,
            names=tuple(names),
            position=None if self.position is None else self.position[:, columns],
            velocity=None if self.velocity is None else self.velocity[:, columns],
            effort=None if self.effort is None else self.effort[:, columns],
        )

    def require(self, quantity: str) -> FloatArray:
        """`position`, `velocity` or `effort`; BagError if no message has it."""
        values: FloatArray | None = getattr(self, quantity)
        if values is None:
            raise BagError(f'topic {self.topic} has no {quantity}')
        return values

    def check_finite(self, quantities: Sequence[str] = QUANTITIES) -> None:
        """BagError for NaN and infinity, with topic, quantity, joint and how many messages."""
        for quantity in quantities:
            values = getattr(self, quantity)
            if values is None or np.isfinite(values).all():
                continue
            bad = ~np.isfinite(values)
            row, column = np.argwhere(bad)[0]
            raise BagError(
                f'topic {self.topic}: {quantity} of {self.names[column]} is {values[row, column]} '
                f'at {self.seconds()[row]:.6f} s; {int(bad.any(axis=1).sum())} of {len(self)} '
                'messages have values that are missing or not finite'
            )


@dataclass(frozen=True)
class PoseSeries:
    """N messages of `geometry_msgs/msg/PoseStamped`; times (N,) as in `JointStateSeries`."""

    topic: str  # full name
    frame_id: str  # of the first message
    stamp_ns: IntArray
    log_ns: IntArray
    publish_ns: IntArray
    sequence: IntArray
    position: FloatArray  # (N, 3), m
    orientation: FloatArray  # (N, 4), quaternions x, y, z, w

    def __len__(self) -> int:
        return len(self.stamp_ns)


def decode_joint_states(
    topic: str, payloads: Payloads, log_ns: IntArray, publish_ns: IntArray, sequence: IntArray
) -> JointStateSeries:
    """Decode all messages of a topic; joints may come in another order in every message."""
    groups = _groups(topic, payloads, joint_state_layout)
    names = tuple(dict.fromkeys(name for group in groups for name in group.layout.names))
    n = len(payloads)
    if len(names) > MOST_JOINTS or n * len(names) > max(_FREE_CELLS, int(payloads.size.sum())):
        raise MalformedMessageError(
            f'topic {topic}: {len(names)} joints in {n} messages, most of which lack most of them'
        )
    stamp_ns = np.zeros(n, dtype=np.int64)
    decoded: dict[str, FloatArray | None] = dict.fromkeys(QUANTITIES)
    place = {name: k for k, name in enumerate(names)}
    for group in groups:
        stamp_ns[group.rows] = group.stamp_ns()
        columns = [place[name] for name in group.layout.names]
        for quantity in QUANTITIES:
            values = group.column(quantity)
            if values is None:
                continue
            target = decoded[quantity]
            if target is None:
                target = decoded[quantity] = np.full((n, len(names)), np.nan)
            target[np.ix_(group.rows, columns)] = values
    return JointStateSeries(topic, names, stamp_ns, log_ns, publish_ns, sequence, **decoded)


def decode_poses(
    topic: str, payloads: Payloads, log_ns: IntArray, publish_ns: IntArray, sequence: IntArray
) -> PoseSeries:
    """Decode all poses of a topic."""
    n = len(payloads)
    stamp_ns = np.zeros(n, dtype=np.int64)
    decoded = {'position': np.full((n, 3), np.nan), 'orientation': np.full((n, 4), np.nan)}
    frame_id = ''
    for group in _groups(topic, payloads, pose_layout):
        stamp_ns[group.rows] = group.stamp_ns()
        for quantity, target in decoded.items():
            target[group.rows] = group.column(quantity)
        frame_id = group.layout.frame_id if group.rows[0] == 0 else frame_id
    return PoseSeries(topic, frame_id, stamp_ns, log_ns, publish_ns, sequence, **decoded)


def _groups(
    topic: str, payloads: Payloads, find_layout: Callable[[bytes], Layout]
) -> list[LayoutGroup]:
    try:
        groups = list(grouped_by_layout(payloads, find_layout))
    except MalformedMessageError as error:
        raise MalformedMessageError(f'topic {topic}: {error}') from error
    return sorted(groups, key=lambda group: int(group.rows[0]))
