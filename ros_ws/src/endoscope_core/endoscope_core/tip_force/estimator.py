"""The force across the tip, with bounds, while the instrument moves."""

import math
from collections import deque
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from endoscope_core.kinematics import tip_lever
from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.effects import describe
from endoscope_core.physics.effects.tracker_delay import EFFECT as TRACKER_DELAY
from endoscope_core.physics.packing import pack
from endoscope_core.signals.samples import Samples
from endoscope_core.tip_force.external_moment import (
    BLOCK_TICKS,
    TICK_S,
    Block,
    ExternalMoment,
    MomentSet,
)
from endoscope_core.tip_force.free_motion import BLOCK_S, LEAST, FreeMotion

Array = NDArray[np.float64]

AHEAD_S = 2.0 * BLOCK_S
"""By how much a force is later than its samples: the angle is the mean of what the tracker reads
this long before and after."""
_AVERAGED = 5
_BOUND = 2.0
"""Standard deviations of that mean within which the angle is."""
_GAP_S, _TRACKER_GAP_S = AHEAD_S, 0.15
"""Longest of motors and load cells, and of the tracker; after a longer one the memory of the
sheaths is unknown."""
_LATE_S = 0.3
"""Largest latency of samples."""
AT_REST_RAD = 2.0 * 2.0 * math.pi / 4096
"""Two counts of an encoder, by which readings of a shaft at rest differ."""
_MOVED = 2.0
"""Half-widths of its bounds by which an angle differs from the mean of a rest only where it moves:
four standard deviations."""
SWEEPS, LEAST_RANGE_RAD = 2.0, 0.3
"""Travel over the visited range, and that range in rad of the shaft, after which a joint's memory
is that of the path: once to either end of it (return-point memory; Mayergoyz, 1991, ch. I)."""
REPORTED_WITHIN_S = 0.3
"""After which a contact is seen."""
LASTING = int((REPORTED_WITHIN_S - AHEAD_S) / BLOCK_S) - 2
"""Blocks in a row, 0.2 s, of which all have to show a contact: where a joint breaks away a moment
earlier or later than its plant, one to four do. Two more are left for the force to grow."""


class State(StrEnum):
    """Whether a force is known, and if not, why."""

    KNOWN = 'known'
    NO_SAMPLES = 'motors, load cells or tracker are silent'
    UNKNOWN_MEMORY = 'every joint has to go through its range once both ways'
    NOT_CALIBRATED = 'its bounds come from motion in free space: calibrate with the sinusoid'


@dataclass(frozen=True)
class TipForce:
    """Force on the tip across its axis at one time; what acts along the axis cannot be seen.

    Attributes
    ----------
    time : float
        s, as the samples.
    force : array (2,)
        N along x and y of the tip's frame, positive where it pushes towards a positive angle; NaN
        for a joint that the plant does not have.
    low, high : array (2,)
        Bounds of both in N.
    widened : array (2,)
        By how much motion in free space has widened the bounds on either side, N; the rest of them
        is what friction leaves open.
    visible : float
        Smallest force in N that would be seen now.
    seen : bool
        Whether something touches the tip.
    """

    time: float
    force: Array
    low: Array
    high: Array
    widened: Array
    visible: float
    seen: bool

    @property
    def size(self) -> float:
        """Size of the force in N."""
        return float(np.linalg.norm(np.nan_to_num(self.force)))

    @property
    def at_least(self) -> float:
        """The smallest force in N within the bounds."""
        nearest = np.clip(0.0, np.nan_to_num(self.low), np.nan_to_num(self.high))
        return float(np.linalg.norm(nearest))

    @property
    def at_most(self) -> float:
        """The largest force in N within the bounds."""
        farthest = np.maximum(np.abs(self.low), np.abs(self.high))
        return float(np.linalg.norm(np.nan_to_num(farthest)))


class _Joint:
    """Observer of one joint, what it has visited, and its misfit in free motion."""

    def __init__(self, observer: ExternalMoment, delay_s: float, free: FreeMotion) -> None:
        self.observer, self.delay_s, self.free = observer, delay_s, free
        self._way, self._low, self._high = 0.0, math.inf, -math.inf
        self._shaft = math.nan
        self._last: deque[MomentSet] = deque(maxlen=LASTING)
        self._rest: list[float] = []  # angles of the blocks since the shaft stands still, rad

    @property
    def memory_is_known(self) -> bool:
        """Whether what was before the first sample is forgotten."""
        visited = self._high - self._low
        return visited >= LEAST_RANGE_RAD and self._way >= SWEEPS * visited

    def follow(self, block: Block) -> MomentSet:
        """As `ExternalMoment.follow`; while the joint is at rest, the last set."""
        shaft = block.shaft
        if self._stands_still(block):
            # Nothing acts but what did. Noise of the tracker, block after block, would have
            # friction build up and look like a push within seconds.
            return self._last[-1]
        if not math.isnan(self._shaft):
            self._way += float(np.abs(np.diff(shaft, prepend=self._shaft)).sum())
        self._shaft = float(shaft[-1])
        self._low, self._high = min(self._low, shaft.min()), max(self._high, shaft.max())
        self._last.append(self.observer.follow(block))
        return self._last[-1]

    def _stands_still(self, block: Block) -> bool:
        """Whether neither shaft nor tip has moved for longer than a contact takes to be seen."""
        moved = not np.abs(block.shaft - self._shaft).max() <= AT_REST_RAD
        if self._rest:
            away = abs(block.angle - sum(self._rest) / len(self._rest))
            moved = moved or away > _MOVED * block.half_width
        self._rest = [] if moved else [*self._rest, block.angle][-LEAST:]
        return self.is_at_rest

    @property
    def is_at_rest(self) -> bool:
        """Whether the last block was not followed."""
        return len(self._rest) > LASTING

    @property
    def lasting(self) -> float:
        """Moment in N m that all of the last blocks exceed on one side; negative where none is."""
        if len(self._last) < LASTING:
            return -math.inf
        return max(min(m.low for m in self._last), -max(m.high for m in self._last))

    @property
    def is_touched(self) -> bool:
        """Whether that is more than free motion shows."""
        return self.lasting > self.free.least_seen

    def learn(self, certain: bool) -> None:
        """Add the last block to those of free motion, which it is `certain` to be or not."""
        if len(self._last) == LASTING and not self.is_at_rest:
            last = self._last[-1]
            # By how much zero is outside of the set; negative within it.
            half = 0.5 * (last.high - last.low)
            self.free.learn(max(last.low, -last.high), self.lasting, half, certain)


class TipForceEstimator:
    """Force on the tip of a rig by its plant.

    Samples are added to `motor` (J columns: shafts in rad), `wires` (2 J: both tensions of each
    joint in N) and `tracker` (J: bending in rad) in any portions; `update` gives what can be
    worked out. While `free` is set, nothing touches the tip, and the bounds are learnt; they are
    learnt on after it for as long as nothing is seen, from 10 min at most.

    Parameters
    ----------
    plant : PlantDescription
        The rig with one or two joints. What depends on time since a recording began is left out.
    section_length : float
        Of the bending section in m.
    """

    def __init__(self, plant: PlantDescription, section_length: float) -> None:
        lasting = [e for e in plant.effects if not describe(e.id).traits.depends_on_time]
        self._plant = replace(plant, effects=tuple(lasting))
        self._parameters, self._on = pack(self._plant)
        self.section_length = section_length
        self._noise = plant.sensors.tracker_noise
        count = len(self._parameters)
        self.motor, self.wires = Samples(count), Samples(2 * count)
        self.tracker = Samples(count)
        self._streams = {'motors': self.motor, 'load cells': self.wires, 'tracker': self.tracker}
        self._joints: list[_Joint] = []
        self.free_motion = [FreeMotion() for _ in self._parameters]
        self._end = math.nan
        self._free = False
        self.state = State.NO_SAMPLES
        self.restarts = 0
        self.restarted_because = ''

    @property
    def free(self) -> bool:
        """Whether nothing touches the tip."""
        return self._free

    @free.setter
    def free(self, free: bool) -> None:
        if free and not self._free:
            for each in self.free_motion:
                each.forget()
        self._free = free

    def update(self, until: float) -> list[TipForce]:
        """Forces since the last call, from samples that are complete at a time in s."""
        found: list[TipForce] = []
        if not all(samples.in_order for samples in self._streams.values()):
            self._restart('the time of the samples has jumped back', math.inf)
        while self._joints or self._started():
            end = self._end + BLOCK_S
            latest = end + AHEAD_S + max(joint.delay_s for joint in self._joints)
            newest = min(samples.time[-1] for samples in self._streams.values())
            if newest < latest and until < latest + _LATE_S:
                break
            flaw = self._flaw(end, latest)
            if flaw:
                self._restart(flaw, latest)
                continue
            force = self._judge(end)
            if force is not None:
                found.append(force)
            self._end = end
            for samples in self._streams.values():
                samples.drop(end - AHEAD_S)
        return found

    def _flaw(self, end: float, latest: float) -> str:
        """Why the samples do not show a block, in words; empty if they do."""
        # What is interpolated at the end needs a sample after it.
        for name, samples in self._streams.items():
            of_tracker = samples is self.tracker
            last, longest = (latest, _TRACKER_GAP_S) if of_tracker else (end + _GAP_S, _GAP_S)
            flaw = samples.flaw(self._end, last, longest)
            if not flaw and not np.isfinite(samples.between(np.array([last]))).all():
                flaw = 'no numbers'
            if flaw:
                return f'{name} were {flaw}'.replace('were no', 'gave no')
        return ''

    def _started(self) -> bool:
        for samples in self._streams.values():
            # Silent to begin with, or without numbers.
            kept = np.isfinite(samples.values).all(axis=1)
            samples.time, samples.values = samples.time[kept], samples.values[kept]
        if not all(len(samples.time) for samples in self._streams.values()):
            return False
        first = max(self.motor.time[0], self.wires.time[0], self.tracker.time[0] + AHEAD_S)
        if self.motor.time[-1] < first:
            return False
        shafts = self.motor.between(np.array([first]))[0]
        for j, (p, on) in enumerate(zip(self._parameters, self._on, strict=True)):
            delay_s = float(p[TRACKER_DELAY.first_parameter]) if on[TRACKER_DELAY.flag] else 0.0
            observer = ExternalMoment(p, on, float(shafts[j]))
            self._joints.append(_Joint(observer, delay_s, self.free_motion[j]))
        self._end = first
        return True

    def _restart(self, because: str, after: float) -> None:
        """Begin after a time with an unknown memory; bounds that were learnt stay."""
        self._joints = []
        self.state = State.NO_SAMPLES
        self.restarts += 1
        self.restarted_because = because
        for samples in self._streams.values():
            kept = samples.time > after
            samples.time, samples.values = samples.time[kept], samples.values[kept]

    def _judge(self, end: float) -> TipForce | None:
        ticks: Array = end + TICK_S * np.arange(1 - BLOCK_TICKS, 1, dtype=np.float64)
        shafts = self.motor.between(ticks)
        tensions = self.wires.between(np.array([end]))[0].reshape(-1, 2)
        around = end + np.linspace(-AHEAD_S, AHEAD_S, _AVERAGED)
        near = np.stack(
            [
                np.interp(around + joint.delay_s, self.tracker.time, column)
                for joint, column in zip(self._joints, self.tracker.values.T, strict=True)
            ]
        )
        angles = near.mean(axis=1).tolist()
        # Where the joint is accelerated by a, the mean is off by a BLOCK_S^2, a quarter of the
        # second difference, which noise has a part in.
        second = near[:, 0] - 2.0 * near[:, _AVERAGED // 2] + near[:, -1]
        curved = np.maximum(0.0, second**2 - 6.0 * self._noise**2) / 16.0
        half_widths = _BOUND * np.sqrt(self._noise**2 / _AVERAGED + curved)
        sets = []
        for j, joint in enumerate(self._joints):
            other = angles[1 - j] if len(angles) > 1 else 0.0
            shaft = np.ascontiguousarray(shafts[:, j])
            block = Block(shaft, angles[j], float(half_widths[j]), other, tensions[j])
            sets.append(joint.follow(block))
        if not all(joint.memory_is_known for joint in self._joints):
            self.state = State.UNKNOWN_MEMORY
            return None
        known = not any(math.isnan(each.bound) for each in self.free_motion)
        goes_on = known and not any(j.is_touched or j.free.is_learnt for j in self._joints)
        if self._free or goes_on:
            for joint in self._joints:
                joint.learn(self._free)
        if not known:
            self.state = State.NOT_CALIBRATED
            return None
        self.state = State.KNOWN
        return self._force(end, angles, sets)

    def _force(self, time: float, angles: list[float], sets: list[MomentSet]) -> TipForce:
        lever = tip_lever(angles, self.section_length)
        force, low, high, widened = (np.full(2, math.nan) for _ in range(4))
        visible = 0.0
        for j, (joint, moments) in enumerate(zip(self._joints, sets, strict=True)):
            force[j] = moments.likely / lever
            widened[j] = joint.free.bound / lever
            low[j] = moments.low / lever - widened[j]
            high[j] = moments.high / lever + widened[j]
            half = 0.5 * (moments.high - moments.low)
            visible = max(visible, (half + joint.free.least_seen) / lever)
        seen = any(joint.is_touched for joint in self._joints)
        return TipForce(time, force, low, high, widened, visible, seen)
