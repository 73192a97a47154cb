"""Change detection on a moving rig: takes samples, raises an alarm."""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.monitoring.jump_test import Jumps, JumpTest, ResidualBlock
from endoscope_core.monitoring.prediction import JOINT_TICK_S, SERVO_TICK_S, PredictionBank
from endoscope_core.monitoring.rig_change import CHANGES, DIRECTIONS, DRIFT_S, SMALLEST, Part
from endoscope_core.monitoring.thresholds import THRESHOLDS
from endoscope_core.physics.description import PlantDescription
from endoscope_core.signals.samples import Samples

Array = NDArray[np.float64]

BLOCK_S = 0.25
_BINS = 5
WINDOWS = np.array([1, 2, 3, 4, 6, 8, 11, 15, 20, 26, 33, 40])
"""Lengths in blocks of the time since a change, 10 s of motion at most."""
LEARNT = 80
"""Blocks of motion, 20 s, before the first report."""
NAMED_AFTER = 16
"""Blocks of motion, 4 s, from an alarm to its stage: the onset of a change is not typical of it."""
TIE = 0.9
"""Share of the largest gain from which on another part is as likely."""
STILL_RAD = 0.02
"""Travel of a shaft in a block below which the joint is at rest."""
SWEEPS, LEAST_RANGE_RAD = 3.0, 0.3
"""Travel over the visited range, and that range in rad of the shaft, after which the state of a
joint no longer depends on where it started."""
LONGEST_GAP_S = 0.1
"""Of motors and setpoints; after a longer gap the state of the wires is unknown."""
LATE_S = 0.3
"""Largest latency of a block's last samples."""
_NOISE = np.array([0.003, 0.05, 0.05, 0.001, 0.01])
_PART_OF = np.array([str(change.part) for change in CHANGES])


@dataclass(frozen=True)
class DetectedChange:
    """A change that was detected; times in s."""

    joint: str
    at: float  # when it was detected
    since: float  # onset, by the likeliest window
    margin: float  # largest log-likelihood gain relative to its threshold
    # Likeliest first; the rest are about as likely. Empty until the change is located.
    parts: tuple[Part, ...] = ()
    change: str = ''  # the likeliest one in words

    def __str__(self) -> str:
        where = ' or '.join(self.parts) or 'stage not known yet'
        what = f' ({self.change})' if self.change else ''
        return f'{self.joint} no longer matches its plant: {where}{what}'


class _Joint:
    """Learnt state and alarm of one joint."""

    def __init__(self, name: str, thresholds: Mapping[str, float]) -> None:
        along = [[float(d.name in c.along) for d in DIRECTIONS] for c in CHANGES]
        drift = np.array([d.drift for d in DIRECTIONS]) * math.sqrt(BLOCK_S / DRIFT_S)
        self.name = name
        self.test = JumpTest(
            np.array([abs(d.tolerance) for d in DIRECTIONS]),
            drift,
            np.array(along),
            np.array([c.one_way for c in CHANGES]),
            np.array([SMALLEST * c.usual for c in CHANGES]),
            _NOISE,
            WINDOWS,
        )
        self._threshold = np.array([thresholds[part] for part in _PART_OF])
        self._times: deque[float] = deque(maxlen=int(WINDOWS[-1]))
        self._since_alarm = 0
        self.alarm: DetectedChange | None = None
        self.jumps: Jumps | None = None
        self.margin = 0.0
        self.moved = 0  # blocks
        self.forget_motion()

    def forget_motion(self) -> None:
        """Restart with an unknown history."""
        self.test.interrupt()
        self._times.clear()
        self._way, self._low, self._high = 0.0, math.inf, -math.inf
        self.margin, self.jumps = 0.0, None

    def moves(self, shaft: Array) -> bool:
        """Follow a shaft (N,) over a block; whether the joint moves and its start is forgotten."""
        way = float(np.abs(np.diff(shaft)).sum())
        self._way += way
        self._low, self._high = min(self._low, shaft.min()), max(self._high, shaft.max())
        visited = self._high - self._low
        return way >= STILL_RAD and visited >= LEAST_RANGE_RAD and self._way > SWEEPS * visited

    def add(self, begin: float, block: ResidualBlock) -> None:
        """Judge a block."""
        if self.alarm is not None and self.alarm.parts:
            return
        self.moved += 1
        self._times.append(begin)
        self.jumps = self.test.add(block)
        if self.jumps is None or self.test.learnt < LEARNT:
            return
        excess = self.jumps.gain / self._threshold
        self.margin = float(excess.max())
        window = int(np.unravel_index(excess.argmax(), excess.shape)[0])
        if self.alarm is None:
            if self.margin >= 1.0:
                # What is judged now must not be learnt as the rig's own.
                self.test.learning = False
                now = begin + BLOCK_S
                self.alarm = DetectedChange(self.name, now, self._began(window), self.margin)
            return
        self._since_alarm += 1
        if self._since_alarm == NAMED_AFTER:
            self.alarm = self._named(self.alarm, self.jumps)

    def _named(self, alarm: DetectedChange, jumps: Jumps) -> DetectedChange:
        best = {part: float(jumps.gain[:, part == _PART_OF].max()) for part in Part}
        likely = sorted(Part, key=lambda part: -best[part])
        parts = tuple(part for part in likely if best[part] >= TIE * best[likely[0]])
        of_part = np.where(parts[0] == _PART_OF, jumps.gain, -1.0)
        window, change = np.unravel_index(of_part.argmax(), of_part.shape)
        return DetectedChange(
            self.name,
            alarm.at,
            min(alarm.since, self._began(int(window))),
            max(alarm.margin, self.margin),
            parts,
            CHANGES[change].name,
        )

    def _began(self, window: int) -> float:
        return self._times[-int(WINDOWS[window])]


class RigWatch:
    """Compares a rig with its description of J joints while it moves.

    Samples are added to `setpoint` (J columns, rad), `motor` (2 J: shaft angles in rad, then
    efforts in N m), `wires` (2 J: both tensions in N of each joint) and `tracker` (J, rad), in any
    portions; `update` judges what is complete. Wires, tracker and efforts may be missing or NaN.
    `thresholds` are log-likelihood gains at which a change of each `Part` is reported.
    """

    def __init__(
        self, plant: PlantDescription, thresholds: Mapping[str, float] = THRESHOLDS
    ) -> None:
        self.joints = [_Joint(name, thresholds) for name in plant.joint_names()]
        count = len(self.joints)
        self._bank = PredictionBank(plant)
        self.setpoint, self.motor = Samples(count), Samples(2 * count)
        self.wires, self.tracker = Samples(2 * count), Samples(count)
        self._begin = math.nan
        self.restarts = 0
        self.restarted_because = ''

    @property
    def alarms(self) -> list[DetectedChange]:
        """One alarm of each joint that has changed."""
        return [joint.alarm for joint in self.joints if joint.alarm is not None]

    @property
    def margin(self) -> float:
        """Largest current gain relative to its threshold."""
        return max(joint.margin for joint in self.joints)

    @property
    def ready(self) -> bool:
        """Whether every joint has moved long enough for a change to be reported."""
        return all(joint.test.learnt >= LEARNT for joint in self.joints)

    def gains(self) -> dict[str, float]:
        """Largest current gain of each part, of joints that have moved long enough."""
        judged = [x.jumps for x in self.joints if x.jumps is not None and x.test.learnt >= LEARNT]
        return {
            str(part): max((float(x.gain[:, part == _PART_OF].max()) for x in judged), default=0.0)
            for part in Part
        }

    def update(self, until: float) -> None:
        """Judge all blocks that are complete at a time in s."""
        streams = (self.setpoint, self.motor, self.wires, self.tracker)
        if not all(samples.in_order for samples in streams):
            self._restart('the time of the samples has jumped back')
        if math.isnan(self._begin) and not self._started():
            return
        while self._complete(until):
            end = self._begin + BLOCK_S
            motor = self.motor.flaw(self._begin, end, LONGEST_GAP_S)
            setpoint = self.setpoint.flaw(self._begin, end, LONGEST_GAP_S)
            if motor or setpoint:
                who = 'motors' if motor else 'setpoints'
                self._restart(f'the {who} were {motor or setpoint}'.replace('were no', 'gave no'))
                return
            self._judge()
            self._begin = end
            for samples in streams:
                samples.drop(end)

    def _started(self) -> bool:
        if not len(self.motor.time) or not len(self.setpoint.time):
            return False
        self._begin = float(max(self.motor.time[0], self.setpoint.time[0]))
        shaft = self.motor.between(np.array([self._begin]))[0, : len(self.joints)]
        if not np.isfinite(shaft).all():
            self._restart('the motors gave no numbers')
            return False
        self._bank.rest(shaft)
        return True

    def _complete(self, until: float) -> bool:
        end = self._begin + BLOCK_S
        return bool(until >= end and self.motor.time[-1:] >= end) or until >= end + LATE_S

    def _restart(self, because: str) -> None:
        """Predict anew from rest; what was learnt of the rig stays."""
        self.restarts += 1
        self.restarted_because = because
        self._begin = math.nan
        for samples in (self.setpoint, self.motor, self.wires, self.tracker):
            samples.clear()
        for joint in self.joints:
            joint.forget_motion()

    def _judge(self) -> None:
        begin, count = self._begin, len(self.joints)
        fine: Array = begin + SERVO_TICK_S * np.arange(
            round(BLOCK_S / SERVO_TICK_S), dtype=np.float64
        )
        grid: Array = begin + JOINT_TICK_S * np.arange(
            round(BLOCK_S / JOINT_TICK_S) + 1, dtype=np.float64
        )
        shaft = self.motor.between(grid)[:, :count]
        behind = self._bank.behind_motors(shaft[1:])
        motors = self._bank.motors(self.setpoint.held(fine))
        motor, wires, tracker = (
            samples.binned(begin, BLOCK_S / _BINS, _BINS)
            for samples in (self.motor, self.wires, self.tracker)
        )
        moved, drawn, bent = motor.means(), wires.means(), tracker.means()
        of_motor, of_wires, of_tracker = (b.means_of(grid) for b in (motor, wires, tracker))
        of_shaft = motor.means_of(fine)
        for j, joint in enumerate(self.joints):
            if not joint.moves(shaft[:, j]):
                continue
            measured = np.column_stack(
                [moved[:, j], drawn[:, 2 * j], drawn[:, 2 * j + 1], moved[:, count + j], bent[:, j]]
            )
            predicted = np.stack(
                [
                    of_shaft @ motors[j],
                    of_wires @ behind[j, :, 0],
                    of_wires @ behind[j, :, 1],
                    of_motor @ behind[j, :, 2],
                    of_tracker @ behind[j, :, 3],
                ],
                axis=1,
            )
            joint.add(begin, ResidualBlock.of(measured - predicted[..., 0], predicted[..., 1:]))
