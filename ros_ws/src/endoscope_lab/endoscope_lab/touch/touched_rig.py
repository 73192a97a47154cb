"""Rigs of both simulators that are identified in free space, and then touch an obstacle."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.control.internal_model import PhysicalParameters
from endoscope_core.control.limits import MotorLimits
from endoscope_core.control.physical_inverse import PhysicalInverse
from endoscope_core.kinematics import tip_lever
from endoscope_core.physics import EffectSpec, PlantDescription
from endoscope_core.rig import shipped_rig
from endoscope_core.tip_force import TipForce, TipForceEstimator
from endoscope_explain.fit.model import joint_of, packed_joint
from endoscope_explain.fit.nominal import nominal_references
from endoscope_explain.observe.observation import observe
from endoscope_explain.recording import RigRecording
from endoscope_lab.concealed import another_rig, motions, readings, rigs

Array = NDArray[np.float64]

SIMULATORS = ('kernel', 'sliding nodes')
STIFFNESS = (20.0, 2000.0)
"""Of an obstacle, N/m."""
DEPTH = (0.2, 0.8)
"""Where it stands, of the largest angle that the hand asks for."""
_HERTZ_RAD = 0.05
"""Depth at which the round obstacle of sliding nodes is as stiff as drawn."""
_PORTION_S = 0.1
"""In which samples arrive."""


@dataclass(frozen=True)
class Touched:
    """What was worked out of one rig's teleoperation, N samples."""

    forces: tuple[TipForce, ...]
    true: Array  # (N, J), N across the tip


class DrawnRig:
    """A drawn rig: its description, its truth, and what it answers to a motion."""

    def __init__(self, generator: np.random.Generator, simulator: str) -> None:
        self._other = simulator == SIMULATORS[1]
        self.described = rigs.described_rig(generator, 1 if self._other else 2)
        true = rigs.true_rig(generator, self.described)
        # Half of the rigs have another form of sheath.
        other_form = generator.random() < 0.5
        self.true = rigs.other_sheath(generator, true) if other_form else true

    def record(
        self, shaft: Array, seed: int, obstacle: 'Obstacle | None' = None
    ) -> tuple[RigRecording, Array]:
        """Readings with noise, and the true angles (M, J) in rad at the tracker's stamps."""
        if self._other:
            (joint,) = self.true.joints.values()
            laws = another_rig.Laws()
            if obstacle is not None:
                hertz = obstacle.stiffness / math.sqrt(_HERTZ_RAD)
                laws = replace(laws, stop_rad=abs(obstacle.angle), stop_stiffness=hertz)
            clean = another_rig.read(joint, laws, shaft)
        else:
            effects = () if obstacle is None else (obstacle.effect(self.true),)
            clean = readings.read(replace(self.true, effects=effects), shaft)
        names, sensors = self.true.joint_names(), self.true.sensors
        return readings.as_sensed(clean, names, sensors, seed), clean.bending

    def forces(self, obstacle: 'Obstacle', bending: Array) -> Array:
        """Forces (M, J) in N across the tip that the obstacle exerts at true angles (M, J)."""
        moments = np.zeros_like(bending)
        q = bending[:, obstacle.joint]
        if self._other:
            deep = np.maximum(0.0, np.abs(q) - abs(obstacle.angle))
            push = obstacle.stiffness / math.sqrt(_HERTZ_RAD) * deep**1.5
            moments[:, obstacle.joint] = -np.sign(q) * push
        else:
            side = math.copysign(1.0, obstacle.angle)
            deep = np.maximum(0.0, side * (q - obstacle.angle))
            moments[:, obstacle.joint] = -side * obstacle.stiffness * deep
        length = shipped_rig().instrument.section_length
        return moments / np.array([tip_lever(angles, length) for angles in bending])[:, None]


@dataclass(frozen=True)
class Obstacle:
    """Something that one joint meets."""

    joint: int
    angle: float  # where, rad
    stiffness: float  # N m/rad

    @property
    def across(self) -> float:
        """Its stiffness across the tip in N/m."""
        return (
            self.stiffness / tip_lever([self.angle], shipped_rig().instrument.section_length) ** 2
        )

    def effect(self, plant: PlantDescription) -> EffectSpec:
        values = {'angle_rad': self.angle, 'stiffness': self.stiffness}
        return EffectSpec('contact', plant.joint_names()[self.joint], values)


@dataclass
class Prepared:
    """A drawn rig whose plant is identified, and whose bounds are learnt in free space."""

    generator: np.random.Generator
    rig: DrawnRig
    plant: PlantDescription
    estimator: TipForceEstimator
    later: float  # s: later than all before by more than any gap, so the memory is found again


def prepared(simulator: str, seed: int) -> Prepared:
    """Identify a drawn rig, and learn its bounds in free teleoperation."""
    generator = np.random.default_rng([seed, SIMULATORS.index(simulator)])
    rig = DrawnRig(generator, simulator)
    count = len(rig.true.joints)
    known, _ = rig.record(motions.commissioning(generator, count), seed)
    plant = identified(known, rig.described)
    estimator = TipForceEstimator(plant, shipped_rig().instrument.section_length)
    free = motions.teleoperation(generator, count)
    estimator.free = True
    watched(estimator, rig.record(compensated(plant, free), seed + 1)[0], 0.0)
    estimator.free = False
    return Prepared(generator, rig, plant, estimator, known.duration + motions.HAND_S)


def teleoperation(generator: np.random.Generator, joints: int, hands: int) -> Array:
    """Some motions of a hand, 30 s each, one after the other (N, joints), as `motions` has them."""
    return np.concatenate([motions.teleoperation(generator, joints) for _ in range(hands)])


def touched(simulator: str, seed: int, obstacle: bool = True, seconds: float = 30.0) -> Touched:
    """Have a prepared rig touch something in teleoperation."""
    ready = prepared(simulator, seed)
    generator, rig, estimator = ready.generator, ready.rig, ready.estimator
    asked = teleoperation(generator, len(rig.true.joints), math.ceil(seconds / motions.HAND_S))
    largest = np.abs(asked).max(axis=0) / shipped_rig().joints.gear
    met = drawn(generator, largest) if obstacle else None
    recording, bending = rig.record(compensated(ready.plant, asked), seed + 2, met)
    forces = watched(estimator, recording, ready.later)
    true_forces = rig.forces(met, bending) if met else np.zeros_like(bending)
    stamps = recording.bending.time + ready.later
    at = np.array([force.time for force in forces])
    true = [np.interp(at, stamps, column) for column in true_forces.T]
    return Touched(tuple(forces), np.stack(true, axis=1))


def identified(recording: RigRecording, described: PlantDescription) -> PlantDescription:
    """The nominal plant fitted to a recording in free space, as `endoscope explain` begins."""
    joints = {}
    for observation in observe(recording, described):
        fitted, _ = nominal_references(observation, *packed_joint(described, observation.joint))
        joints[observation.joint] = joint_of(fitted.model.packed(fitted.theta)[0])
    return replace(described, joints=joints)


def drawn(
    generator: np.random.Generator, largest: Array, stiffness: tuple[float, float] = STIFFNESS
) -> Obstacle:
    """Draw an obstacle of so many N/m in the way of a motion to largest angles (J,) in rad."""
    joint = int(generator.integers(len(largest)))
    side = float(generator.choice([-1.0, 1.0]))
    angle = side * generator.uniform(*DEPTH) * float(largest[joint])
    lever = tip_lever([angle], shipped_rig().instrument.section_length)
    across = math.exp(generator.uniform(*np.log(stiffness)))
    return Obstacle(joint, angle, across * lever**2)


def compensated(plant: PlantDescription, shaft: Array) -> Array:
    """Shaft commands (N, J) in rad by the plant's inverse for those of a hand without one."""
    rig, tick = shipped_rig(), 1.0 / motions.RATE
    desired = shaft / rig.joints.gear
    speed = np.gradient(desired, tick, axis=0)
    sent = np.empty_like(desired)
    for j, joint in enumerate(plant.joints.values()):
        inverse = PhysicalInverse(PhysicalParameters(joint), MotorLimits.of(rig))
        inverse.begin(0.0, float(desired[0, j]), float(speed[0, j]))
        sent[:, j] = [
            inverse.wanted(q, v, tick)
            for q, v in zip(desired[:, j].tolist(), speed[:, j].tolist(), strict=True)
        ]
    return rig.joints.gear * sent


def watched(estimator: TipForceEstimator, recording: RigRecording, later: float) -> list[TipForce]:
    """Forces from a recording whose stamps are later by so many s, in portions as they arrive."""
    found = []
    for begin in np.arange(0.0, recording.duration, _PORTION_S):
        found += portion(estimator, recording, later, (begin, begin + _PORTION_S))
    return found


def portion(
    estimator: TipForceEstimator,
    recording: RigRecording,
    later: float,
    between: tuple[float, float],
) -> list[TipForce]:
    """Forces that are found once what was recorded between two times in s has arrived."""
    measured = recording.measured()
    streams = (
        (estimator.motor, measured['shaft_position']),
        (estimator.wires, measured['tension']),
        (estimator.tracker, measured['bending']),
    )
    for samples, series in streams:
        rows = slice(*np.searchsorted(series.time, between))
        samples.append(series.time[rows] + later, series.values[rows])
    return estimator.update(later + between[1])


def free_tails(simulator: str, seed: int) -> list[tuple[float, float, int, float]]:
    """`FreeMotion.tail` of every joint of a rig, after 60 s of motion more."""
    ready = prepared(simulator, seed)
    estimator, count = ready.estimator, len(ready.rig.true.joints)
    asked = teleoperation(ready.generator, count, 2)
    estimator.free = True
    watched(estimator, ready.rig.record(compensated(ready.plant, asked), seed + 2)[0], ready.later)
    return [each.tail() for each in estimator.free_motion]
