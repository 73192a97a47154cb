"""Rigs as they come out of the workshop, in tubes as a patient bends them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from endoscope_core.metrics import width_at_mid_height
from endoscope_core.plant import JointParameters, PlantDescription, simulate
from endoscope_core.signals import CALIBRATION_RATE, CALIBRATION_SAMPLES, calibration_sinusoid

JOINTS = ('bend_x', 'bend_y')
SMALLEST_EXPONENT = 0.02
GREATEST_EXPONENT = 4.0

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
    backlash_size : float
        Mean of the joints' backlash sizes in rad under the calibration sinusoid.
    """

    plant: PlantDescription
    exponent: float
    backlash_size: float


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


def in_tube(rig: PlantDescription, exponent: float) -> PlantDescription:
    """A rig of `random_rig` in a tube of the given capstan exponent."""
    joints = {
        name: replace(joint, capstan_exponent=exponent * joint.capstan_exponent)
        for name, joint in rig.joints.items()
    }
    return replace(rig, joints=joints)


def calibration_command(plant: PlantDescription) -> NDArray[np.float64]:
    """Shaft command (9000, J) in rad of the uncompensated calibration sinusoid on all joints."""
    time = np.arange(CALIBRATION_SAMPLES) / CALIBRATION_RATE
    angle, _ = calibration_sinusoid()(time)
    gears = np.array([joint.gear for joint in plant.joints.values()])
    return angle[:, None] * gears


def backlash_sizes(plant: PlantDescription) -> NDArray[np.float64]:
    """Backlash size in rad of each joint (J,) in the last whole period of the calibration."""
    signal = calibration_sinusoid()
    trajectory = simulate(plant, calibration_command(plant))
    settled = trajectory.time >= signal.steady[0]
    desired, _ = signal(trajectory.time[settled])
    bending = trajectory.bending_true[settled]
    return np.array([width_at_mid_height(desired, column) for column in bending.T])


def configuration_of_size(rig: PlantDescription, size: float) -> TubeConfiguration | None:
    """Bend the tube until the mean backlash size of both joints is `size` (rad).

    Returns
    -------
    TubeConfiguration or None
        None where no tube, straight or bent, gives this rig that size.
    """

    def excess(exponent: float) -> float:
        return float(np.mean(backlash_sizes(in_tube(rig, exponent)))) - size

    if excess(SMALLEST_EXPONENT) > 0.0 or excess(GREATEST_EXPONENT) < 0.0:
        return None
    exponent = float(brentq(excess, SMALLEST_EXPONENT, GREATEST_EXPONENT, xtol=1e-4, rtol=1e-4))
    return TubeConfiguration(in_tube(rig, exponent), exponent, size + excess(exponent))
