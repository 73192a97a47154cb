"""Rigs as they come out of the workshop, in tubes as a patient bends them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from endoscope_core.effects import distributed_friction
from endoscope_core.metrics import width_at_mid_height
from endoscope_core.plant import EffectSpec, JointParameters, PlantDescription, simulate
from endoscope_core.signals import CALIBRATION_RATE, CalibrationMotion, calibration_motion

JOINTS = ('bend_x', 'bend_y')
SMALLEST_EXPONENT = 0.02
USUAL_EXPONENT = 2.5
# From somewhat more on the sinusoid no longer drags every joint round a closed loop.
GREATEST_EXPONENT = 3.0

# Half-widths of uniform relative spreads from instrument to instrument, by manufacture and wear.
RELATIVE_SPREAD = {
    'wire_stiffness': 0.10,
    'joint_radius': 0.01,
    'presliding_distance': 0.20,
    'joint_stiffness': 0.10,
    'joint_damping': 0.15,
    'joint_friction': 0.10,
    'joint_presliding': 0.15,
    'motor_bandwidth': 0.05,
    'motor_damping_ratio': 0.05,
}
# The joints of one instrument are made alike: they share all but this part of its spread.
JOINT_SHARE = 0.2
# So much that the tensions of one rig in tubes of like hysteresis differ by 0.05, 0.15 and 0.4 N
# rms at 54, 85 and 105 deg, where the first paper has about 0.2 N (Table 1).
GREATEST_EVENNESS = 0.25
PRETENSION_DEVIATION = 0.1
EXPONENT_SPREAD = 0.02


@dataclass(frozen=True)
class TubeConfiguration:
    """A rig in a tube of a certain shape.

    Parameters
    ----------
    plant : PlantDescription
        Both joints, with the capstan exponent that the shape gives.
    exponent : float
        Capstan exponent of the tube; each joint's own lies within 2 % of it.
    evenness : float
        How evenly the curvature is spread over the tube's segments, see `in_tube`.
    joint_sizes : tuple of float
        Backlash size of each joint in rad under the calibration sinusoid.
    """

    plant: PlantDescription
    exponent: float
    evenness: float
    joint_sizes: tuple[float, ...]

    @property
    def backlash_size(self) -> float:
        """Mean of the joints' backlash sizes in rad."""
        return float(np.mean(self.joint_sizes))


def random_rig(generator: np.random.Generator) -> PlantDescription:
    """Two joints whose every parameter is off by what manufacture, wear and handling give.

    The relative spreads are `RELATIVE_SPREAD`, uniform, four fifths of each common to both joints;
    pretension is set by hand to 5 N with a
    standard deviation of 0.1 N. The pulley radius is kept with the joint radius, so that the gear
    is the one that the controller knows. The capstan exponent of each joint is a factor near one
    here, to be multiplied with the tube's.
    """
    nominal = JointParameters()
    common = {key: generator.uniform(-1.0, 1.0) for key in RELATIVE_SPREAD}
    joints = {}
    for name in JOINTS:
        changes = {
            key: getattr(nominal, key)
            * (
                1.0
                + spread
                * ((1.0 - JOINT_SHARE) * common[key] + JOINT_SHARE * generator.uniform(-1.0, 1.0))
            )
            for key, spread in RELATIVE_SPREAD.items()
        }
        changes['pulley_radius'] = changes['joint_radius'] / nominal.gear
        changes['pretension'] = nominal.pretension + PRETENSION_DEVIATION * generator.normal()
        changes['capstan_exponent'] = 1.0 + EXPONENT_SPREAD * generator.uniform(-1.0, 1.0)
        joints[name] = replace(nominal, **changes)
    return PlantDescription(joints=joints)


def in_tube(rig: PlantDescription, exponent: float, evenness: float = 0.0) -> PlantDescription:
    """A rig of `random_rig` in a tube.

    Parameters
    ----------
    rig : PlantDescription
    exponent : float
        Capstan exponent, the friction coefficient times the sum of all bends of the tube.
    evenness : float
        Share of the bends that is spread evenly over eight segments of the tube; the rest is at
        its two ends. 0 is the nominal plant's transmission.
    """
    joints = {
        name: replace(joint, capstan_exponent=exponent * joint.capstan_exponent)
        for name, joint in rig.joints.items()
    }
    along: tuple[EffectSpec, ...] = ()
    if evenness > 0.0:
        identity = distributed_friction.DEFINITION.id
        along = tuple(EffectSpec(identity, name, {'share': evenness}) for name in joints)
    return replace(rig, joints=joints, effects=(*rig.effects, *along))


def calibration_command(
    plant: PlantDescription, motion: CalibrationMotion | None = None
) -> NDArray[np.float64]:
    """Shaft command (N, J) in rad of an uncompensated calibration motion on all joints.

    N are the samples of the motion's record; the motion is the sinusoid if not given.
    """
    motion = motion or calibration_motion()
    angle, _ = motion.signal(np.arange(motion.samples) / CALIBRATION_RATE)
    gears = np.array([joint.gear for joint in plant.joints.values()])
    return angle[:, None] * gears


def backlash_sizes(plant: PlantDescription) -> NDArray[np.float64]:
    """Backlash size in rad of each joint (J,) in the last whole period of the sinusoid."""
    motion = calibration_motion()
    trajectory = simulate(plant, calibration_command(plant, motion))
    settled = trajectory.time >= motion.signal.steady[0]
    desired, _ = motion.signal(trajectory.time[settled])
    bending = trajectory.bending_true[settled]
    return np.array([width_at_mid_height(desired, column) for column in bending.T])


def configuration_of_size(
    rig: PlantDescription, size: float, evenness: float = 0.0
) -> TubeConfiguration | None:
    """Bend the tube until the mean backlash size of both joints is `size` (rad).

    Returns
    -------
    TubeConfiguration or None
        None where no tube, straight or bent, gives this rig that size.
    """

    def excess(exponent: float) -> float:
        return float(np.mean(backlash_sizes(in_tube(rig, exponent, evenness)))) - size

    between = (SMALLEST_EXPONENT, USUAL_EXPONENT)
    if excess(USUAL_EXPONENT) < 0.0:
        between = (USUAL_EXPONENT, GREATEST_EXPONENT)
    if excess(between[0]) > 0.0 or excess(between[1]) < 0.0:
        return None
    exponent = float(brentq(excess, *between, xtol=1e-4, rtol=1e-4))
    plant = in_tube(rig, exponent, evenness)
    return TubeConfiguration(plant, exponent, evenness, tuple(backlash_sizes(plant).tolist()))
