"""Change detection: rigs that change while they move, and the alarms of a watch."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from endoscope_core.monitoring import Part, RigWatch
from endoscope_core.monitoring.rig_watch import BLOCK_S
from endoscope_core.monitoring.thresholds import THRESHOLDS
from endoscope_core.physics import EffectSpec, PlantDescription, SensorModel, layout
from endoscope_core.physics.effects import describe
from endoscope_core.physics.kernel import run_joints
from endoscope_core.physics.packing import pack, rest_state
from endoscope_core.physics.simulator import TICK
from endoscope_lab.concealed import motions, rigs

Array = NDArray[np.float64]

KINDS = {
    'cell zero': Part.CELL,
    'cell gain': Part.CELL,
    'slip of a cable': Part.WIRE,
    'tracker shift': Part.TRACKER,
    'lost pretension': Part.WIRE,
    'tighter tube': Part.SHEATH,
    'higher friction': Part.JOINT,
    'contact': Part.JOINT,
    'gear backlash': Part.ACTUATOR,
    'slower servo': Part.ACTUATOR,
}
SIZES = (0.7, 1.5)
"""Range of a change, over the typical size of the effect in the catalogue."""
REPORTED_WITHIN_S = 10.0
SEGMENT_S = 600.0
"""Length of nominal motion of one drawn rig, tube, sheath and hand."""
Moved = Callable[[np.random.Generator, int], Array]
"""Draws setpoints (N, J) in rad for J joints."""
# Half of the time a surgeon's hand, otherwise identification motions.
_MOTIONS: tuple[Moved, ...] = (
    motions.commissioning,
    motions.another,
    motions.teleoperation,
    motions.teleoperation,
)
_BLOCK = round(BLOCK_S / TICK)
_TRACKER_TICKS = 25
_CHANGE_S, _AFTER_S = (50.0, 80.0), 16.0
_AT_OFF = {
    'load_cell_bias': {'bias_n': 0.0},
    'load_cell_gain': {'gain': 1.0},
    'tracker_bias': {'bias_rad': 0.0},
    'contact': {'stiffness': 0.0},
    'gear_backlash': {'gap_rad': 0.0},
    'actuator_lag': {'time_constant_s': 0.0},
}
_OF_EFFECT = {
    'cell zero': ('load_cell_bias', 0.0, 0.3),
    'cell gain': ('load_cell_gain', 1.0, 0.15),
    'tracker shift': ('tracker_bias', 0.0, 0.05),
    'gear backlash': ('gear_backlash', 0.0, 0.1),
    'slower servo': ('actuator_lag', 0.0, 0.03),
}
"""Effect of the catalogue, the neutral value of its first parameter, and its typical offset."""
_BOTH_WAYS = ('cell zero', 'cell gain', 'tracker shift', 'contact')
_SLIPPED_M, _LOST_N, _TIGHTER, _ROUGHER, _STIFFNESS = 5e-4, 1.6, 0.6, 0.6, 0.01


@dataclass(frozen=True)
class Watched:
    """Alarms of a watch on one rig; times in s of motion."""

    kind: str  # in `KINDS`, or empty for none
    seed: int
    changed_at: float
    alarm_at: float  # first alarm; NaN if there was none
    part: str  # likeliest of that alarm, or empty
    alarms: tuple[str, ...]
    largest: Mapping[str, float]  # largest gain of each part

    @property
    def early(self) -> bool:
        """Whether there was an alarm before anything had changed."""
        return bool(self.alarms) and not (self.kind and self.alarm_at > self.changed_at)

    @property
    def reported(self) -> bool:
        """Whether the change was reported in time."""
        return not self.early and self.alarm_at <= self.changed_at + REPORTED_WITHIN_S

    @property
    def right(self) -> bool:
        """Whether it was reported for its part of the rig."""
        return self.reported and self.part == KINDS[self.kind]


def watched(kind: str, seed: int, thresholds: Mapping[str, float] = THRESHOLDS) -> Watched:
    """Move a drawn rig on one core, change it if a kind is given, and watch it."""
    with threadpool_limits(1):
        return _watched(kind, seed, thresholds)


def _watched(kind: str, seed: int, thresholds: Mapping[str, float]) -> Watched:
    generator = np.random.default_rng([seed, [*KINDS, ''].index(kind)])
    described = rigs.described_rig(generator, 2)
    true = rigs.true_rig(generator, described)
    if generator.random() < 0.5:
        true = rigs.other_sheath(generator, true)
    at = BLOCK_S * round(generator.uniform(*_CHANGE_S) / BLOCK_S)
    moving = motion_of(generator, at + _AFTER_S if kind else SEGMENT_S, _MOTIONS)
    rig = _ChangingRig(generator, true, kind, at)
    watch, sensors = RigWatch(described, thresholds), SensorModel(true.sensors, seed)
    largest = dict.fromkeys(map(str, Part), 0.0)
    for begin in range(0, len(moving) - _BLOCK + 1, _BLOCK):
        setpoint = moving[begin : begin + _BLOCK]
        show(watch, sensors, begin, setpoint, rig.move(setpoint))
        for part, gain in watch.gains().items():
            largest[part] = max(largest[part], gain)
    alarms = sorted(watch.alarms, key=lambda alarm: alarm.at)
    return Watched(
        kind,
        seed,
        at,
        alarms[0].at if alarms else math.nan,
        str(next(iter(alarms[0].parts), '')) if alarms else '',
        tuple(f'{alarm.at - at:+.1f} s {alarm}' for alarm in alarms),
        largest,
    )


def motion_of(generator: np.random.Generator, seconds: float, kinds: Sequence[Moved]) -> Array:
    """Setpoints (N, 2) in rad of motions drawn from some kinds."""
    parts: list[Array] = []
    while sum(map(len, parts)) * TICK < seconds:
        parts.append(kinds[int(generator.integers(len(kinds)))](generator, 2))
    return np.concatenate(parts)[: round(seconds / TICK)]


def show(
    watch: RigWatch, sensors: SensorModel, begin: int, setpoint: Array, readings: Array
) -> None:
    """Feed a watch with noise-free readings (J, N, OUTPUTS) from a tick on, through sensors."""
    time, out = (begin + np.arange(len(setpoint))) * TICK, readings.transpose(1, 0, 2)
    watch.setpoint.append(time, setpoint)
    shaft = sensors.shaft_position(out[:, :, layout.OUT_MOTOR])
    effort = sensors.shaft_effort(out[:, :, layout.OUT_EFFORT])
    watch.motor.append(time, np.hstack([shaft, effort]))
    wires = out[:, :, layout.OUT_TENSION_A : layout.OUT_TENSION_B + 1]
    watch.wires.append(time, sensors.tension(wires))
    seen = slice(None, None, _TRACKER_TICKS)
    watch.tracker.append(time[seen], sensors.bending(out[seen, :, layout.OUT_BENDING]))
    watch.update(float(time[-1]))


class MovingRig:
    """A simulated rig at rest, whose packed parameters and state may be changed while it moves."""

    def __init__(self, plant: PlantDescription) -> None:
        self.parameters, self._on = pack(plant)
        self.state = rest_state(self.parameters, self._on, TICK)

    def move(self, setpoint: Array) -> Array:
        """Noise-free readings (J, N, OUTPUTS) while setpoints (N, J) are in force."""
        joints, ticks = len(self.parameters), len(setpoint)
        inputs = np.zeros((joints, ticks, layout.INPUTS))
        inputs[:, :, layout.IN_COMMAND], inputs[:, :, layout.IN_MOTOR] = setpoint.T, np.nan
        out = np.empty((joints, ticks, layout.OUTPUTS))
        run_joints(*self.state, self.parameters, self._on, inputs, True, TICK, out)
        return out


class _ChangingRig(MovingRig):
    """A simulated rig whose parameters, or wires, change at a moment."""

    def __init__(
        self, generator: np.random.Generator, true: PlantDescription, kind: str, at: float
    ) -> None:
        self._kind, self._at = kind, round(at / TICK)
        self._joint, self._wire = int(generator.integers(2)), int(generator.integers(2))
        self._size, self._depth = generator.uniform(*SIZES), generator.uniform(0.3, 0.6)
        self._sign = generator.choice([-1.0, 1.0]) if kind in _BOTH_WAYS else 1.0
        effects = []
        for j, name in enumerate(true.joints):
            off = {effect: dict(values) for effect, values in _AT_OFF.items()}
            for cell in ('load_cell_bias', 'load_cell_gain'):
                off[cell]['wire'] = float(self._wire)
            tighter = kind == 'tighter tube' and j == self._joint
            factor = 1.0 + _TIGHTER * self._size if tighter else 1.0
            off['configuration_change'] = {'time_s': at, 'factor': factor}
            effects += [EffectSpec(effect, name, values) for effect, values in off.items()]
        self._stiffness = true.joints[true.joint_names()[self._joint]].wire_stiffness
        super().__init__(replace(true, effects=tuple(effects)))
        self._ticks, self._bent = 0, (0.0, 0.0)

    def move(self, setpoint: Array) -> Array:
        """Noise-free readings (J, N, OUTPUTS) while setpoints (N, J) are in force."""
        if self._kind and self._ticks == self._at:
            self._change()
        out = super().move(setpoint)
        self._ticks += len(setpoint)
        bent = out[self._joint, :, layout.OUT_JOINT]
        self._bent = min(self._bent[0], bent.min()), max(self._bent[1], bent.max())
        return out

    def _change(self) -> None:
        row, state = self.parameters[self._joint], self.state[0][self._joint]
        if self._kind in _OF_EFFECT:
            effect, off, typical = _OF_EFFECT[self._kind]
            row[describe(effect).first_parameter] = off + self._sign * self._size * typical
        elif self._kind == 'slip of a cable':
            state[layout.TRAVEL + self._wire] += self._size * _SLIPPED_M
        elif self._kind == 'lost pretension':
            state[layout.TRAVEL : layout.TRAVEL + 2] += self._size * _LOST_N / self._stiffness
        elif self._kind == 'higher friction':
            row[layout.JOINT_FRICTION] *= 1.0 + self._size * _ROUGHER
        elif self._kind == 'contact':
            # Within the range of the motion so far: a contact that is not touched is unobservable.
            first = describe('contact').first_parameter
            row[first] = self._depth * self._bent[int(self._sign > 0.0)]
            row[first + 1] = self._size * _STIFFNESS
