"""Instruments with manufacturing tolerances, in tubes as a patient bends them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from endoscope_core.metrics import NoLoopError, width_at_mid_height
from endoscope_core.names import JOINTS
from endoscope_core.physics import PlantDescription, simulate
from endoscope_core.physics.family import MOST_BENT, TubeFamily, shipped_family
from endoscope_core.rig import shipped_rig
from endoscope_core.signals import CALIBRATION_RATE, CalibrationMotion, calibration_motion

RELATIVE_SPREAD = {
    'capstan_exponent': 0.5,
    'wire_stiffness': 0.10,
    'joint_radius': 0.01,
    'pulley_radius': 0.01,
    'joint_stiffness': 0.15,
    'joint_damping': 0.15,
    'joint_friction': 0.20,
    'joint_presliding': 0.15,
    'section_friction': 0.20,
    'motor_bandwidth': 0.05,
    'motor_damping_ratio': 0.05,
}
"""Half-widths of uniform relative spreads between instruments, by manufacture and wear.

Friction of a wire in its sheath ranges from a fresh to a dry lubricant."""

JOINT_SHARE = 0.2
"""Share of the spread that differs between the joints of one instrument; the rest is common."""
PRETENSION_DEVIATION = 0.1
TIGHTENING_SPREAD = 0.1
GREATEST_UNEVENNESS = 0.4
"""Half-width of the first coefficient of the friction profile, by where the tube is bent along its
length; at the largest, friction at the tip is twice that at the motor."""


@dataclass(frozen=True)
class Instrument:
    """Differences of an instrument from the recorded one, joint by joint."""

    factors: Mapping[str, Mapping[str, float]]  # on parameters, by their names
    pretension: Mapping[str, float]  # added to the pretension, N
    tightening: Mapping[str, float]  # added to the pretension profile


@dataclass(frozen=True)
class TubeConfiguration:
    """An instrument in a tube of a certain shape; angles in rad."""

    plant: PlantDescription  # both joints
    bend: float  # sum of the tube's bends, rad
    # Added to the first coefficient of the friction profile, by where the tube is bent.
    unevenness: float
    # Backlash size of each joint in rad under the calibration sinusoid.
    joint_sizes: tuple[float, ...]

    @property
    def backlash_size(self) -> float:
        """Mean of the joints' backlash sizes in rad."""
        return float(np.mean(self.joint_sizes))


def random_instrument(generator: np.random.Generator, widening: float = 1.0) -> Instrument:
    """An instrument with random deviations of manufacture, wear and handling.

    Relative spreads are uniform by `RELATIVE_SPREAD`, with four fifths of each common to both
    joints; the pretension has a standard deviation of 0.1 N. All are widened by `widening`.
    """
    common = {key: generator.uniform(-1.0, 1.0) for key in RELATIVE_SPREAD}
    own = {name: {key: generator.uniform(-1.0, 1.0) for key in RELATIVE_SPREAD} for name in JOINTS}
    return Instrument(
        {
            name: {
                key: 1.0
                + widening * spread * ((1.0 - JOINT_SHARE) * common[key] + JOINT_SHARE * each[key])
                for key, spread in RELATIVE_SPREAD.items()
            }
            for name, each in own.items()
        },
        {name: widening * PRETENSION_DEVIATION * generator.normal() for name in JOINTS},
        {name: widening * TIGHTENING_SPREAD * generator.uniform(-1.0, 1.0) for name in JOINTS},
    )


def with_pretension_reset(instrument: Instrument, generator: np.random.Generator) -> Instrument:
    """The same instrument with its pretension set again."""
    other = random_instrument(generator)
    return replace(instrument, pretension=other.pretension, tightening=other.tightening)


def in_tube(
    instrument: Instrument,
    bend: float,
    unevenness: float = 0.0,
    family: TubeFamily | None = None,
) -> PlantDescription:
    """An instrument in a tube (by default of the shipped family) with `bend` rad of bends."""
    joint = (family or shipped_family()).joint(bend)
    profile = joint.friction_profile or (0.0,)
    joints = {}
    for name, factors in instrument.factors.items():
        scaled = {key: getattr(joint, key) * factor for key, factor in factors.items()}
        joints[name] = replace(
            joint,
            pretension=joint.pretension + instrument.pretension[name],
            pretension_profile=min(
                1.0, max(-1.0, joint.pretension_profile + instrument.tightening[name])
            ),
            friction_profile=(profile[0] + unevenness, *profile[1:]),
            **scaled,
        )
    return PlantDescription(joints=joints)


def calibration_command(
    plant: PlantDescription, motion: CalibrationMotion | None = None
) -> NDArray[np.float64]:
    """Shaft command (N, J) in rad of an uncompensated calibration motion on all joints.

    N are the samples of the motion's record; the motion is the sinusoid if not given.
    """
    motion = motion or calibration_motion()
    angle, _ = motion.signal(np.arange(motion.samples) / CALIBRATION_RATE)
    return np.repeat(shipped_rig().joints.gear * angle[:, None], len(plant.joints), axis=1)


def backlash_sizes(plant: PlantDescription) -> NDArray[np.float64]:
    """Backlash size in rad of each joint (J,) in the last whole period of the sinusoid."""
    motion = calibration_motion()
    trajectory = simulate(plant, calibration_command(plant, motion))
    settled = trajectory.time >= motion.signal.steady[0]
    desired, _ = motion.signal(trajectory.time[settled])
    bending = trajectory.bending_true[settled]
    return np.array([width_at_mid_height(desired, column) for column in bending.T])


def configuration_of_size(
    instrument: Instrument, size: float, unevenness: float = 0.0
) -> TubeConfiguration | None:
    """Bend the tube until the mean backlash size of both joints is `size` (rad).

    None if the size is larger even in the straight tube, or smaller even in the most bent one, or
    if there is no loop because friction holds the joint.
    """

    def excess(bend: float) -> float:
        return float(np.mean(backlash_sizes(in_tube(instrument, bend, unevenness)))) - size

    try:
        if excess(0.0) > 0.0 or excess(MOST_BENT) < 0.0:
            return None
        bend = float(brentq(excess, 0.0, MOST_BENT, xtol=1e-4, rtol=1e-4))
    except NoLoopError:
        return None
    plant = in_tube(instrument, bend, unevenness)
    return TubeConfiguration(plant, bend, unevenness, tuple(backlash_sizes(plant).tolist()))
