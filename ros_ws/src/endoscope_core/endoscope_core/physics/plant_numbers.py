"""The numbers of a plant: unit, meaning, reach, and what of a rig each belongs to, in one table."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from endoscope_core.physics.effect import Stage


class Keeper(StrEnum):
    """What keeps a number from one recording of a rig to the next."""

    DEVICE = 'device'  # one number, whatever the tube
    JOINT = 'joint'  # scatters a little from one shape of the tube to the next
    SHAPE = 'shape'  # of the tube: another one in each


@dataclass(frozen=True, kw_only=True)
class PlantNumber:
    """What is known of one key of a plant beside its nominal value, in SI units.

    A healthy rig's number is the described one but for a factor (`scaled`), or is off by `spread`
    (rms), or is as it was drawn and machined.
    """

    unit: str
    meaning: str
    # Of a steerable instrument drawn by wires.
    low: float
    high: float
    endless: bool = False  # a plant file may have `.inf` for `high`
    stage: Stage
    scaled: bool = False
    spread: float = 0.0
    keeper: Keeper = Keeper.JOINT


NUMBERS: Mapping[str, PlantNumber] = {
    'pretension': PlantNumber(
        unit='N', low=0.0, high=1e3, stage=Stage.TRANSMISSION, scaled=True,
        meaning='tension of each wire at the motor before the start',
    ),
    'pretension_profile': PlantNumber(
        unit='', low=-1.0, high=1.0, stage=Stage.TRANSMISSION, spread=0.25, keeper=Keeper.SHAPE,
        meaning='how the wires were tightened: 1 from the motor, 0 evenly, -1 to 1',
    ),
    'wire_stiffness': PlantNumber(
        unit='N/m', low=1.0, high=1e7, endless=True, stage=Stage.TRANSMISSION, scaled=True,
        meaning='stiffness of a whole wire',
    ),
    'pulley_radius': PlantNumber(
        unit='m', low=1e-4, high=0.1, stage=Stage.TRANSMISSION, keeper=Keeper.DEVICE,
        meaning='radius at which the wires are wound at the motor',
    ),
    'joint_radius': PlantNumber(
        unit='m', low=1e-4, high=0.1, stage=Stage.TRANSMISSION, keeper=Keeper.DEVICE,
        meaning='radius at which the wires act on the joint',
    ),
    'capstan_exponent': PlantNumber(
        unit='', low=0.0, high=10.0, stage=Stage.TRANSMISSION, scaled=True, keeper=Keeper.SHAPE,
        meaning='friction times the bend of the whole sheath; what its shape changes',
    ),
    'joint_stiffness': PlantNumber(
        unit='N m/rad', low=0.0, high=10.0, stage=Stage.JOINT, scaled=True,
        meaning='elastic moment of the bending section',
    ),
    'joint_rest_angle': PlantNumber(
        unit='rad', low=-math.pi, high=math.pi, stage=Stage.JOINT, spread=0.05,
        keeper=Keeper.SHAPE,
        meaning='angle at which the bending section rests without wires',
    ),
    'joint_friction': PlantNumber(
        unit='N m', low=0.0, high=10.0, stage=Stage.JOINT, scaled=True,
        meaning='Dahl friction of the joint',
    ),
    'joint_presliding': PlantNumber(
        unit='rad', low=1e-5, high=math.pi, stage=Stage.JOINT, scaled=True,
        meaning='angle over which that friction builds up',
    ),
    'joint_presliding_spread': PlantNumber(
        unit='', low=0.0, high=5.0, stage=Stage.JOINT, spread=0.5,
        meaning='spread of three such angles, 0 for one',
    ),
    'joint_damping': PlantNumber(
        unit='N m s/rad', low=1e-7, high=10.0, stage=Stage.JOINT, scaled=True,
        meaning='viscous moment of the bending section',
    ),
    'motor_bandwidth': PlantNumber(
        unit='rad/s', low=0.1, high=1e4, endless=True, stage=Stage.ACTUATOR, scaled=True,
        keeper=Keeper.DEVICE,
        meaning="natural frequency of the servo's position loop",
    ),
    'motor_damping_ratio': PlantNumber(
        unit='', low=0.01, high=100.0, stage=Stage.ACTUATOR, scaled=True, keeper=Keeper.DEVICE,
        meaning='its damping ratio',
    ),
    'friction_profile': PlantNumber(
        unit='', low=-5.0, high=5.0, stage=Stage.TRANSMISSION, spread=0.5, keeper=Keeper.SHAPE,
        meaning='how friction is spread along the wire: cosine coefficients, [] evenly',
    ),
    'load_cell_noise': PlantNumber(
        unit='N', low=0.0, high=1e3, stage=Stage.SENSING,
        meaning='noise (rms) of the load cells',
    ),
    'load_cell_resolution': PlantNumber(
        unit='N', low=0.0, high=1e3, stage=Stage.SENSING, meaning='their step',
    ),
    'load_cell_rate': PlantNumber(
        unit='Hz', low=0.1, high=1e5, stage=Stage.SENSING,
        meaning='their rate, and that of the motors where a bag has none',
    ),
    'tracker_noise': PlantNumber(
        unit='rad', low=0.0, high=math.pi, stage=Stage.SENSING,
        meaning='noise (rms) of the bending angle from the tracker',
    ),
    'tracker_rate': PlantNumber(
        unit='Hz', low=0.1, high=1e5, stage=Stage.SENSING, meaning='its rate',
    ),
    'encoder_counts': PlantNumber(
        unit='counts a turn', low=1.0, high=2.0**32, stage=Stage.SENSING,
        meaning="of the motor's encoder",
    ),
    'velocity_resolution': PlantNumber(
        unit='rad/s', low=0.0, high=1e3, stage=Stage.SENSING,
        meaning="step of the motor's velocity",
    ),
    'effort_noise': PlantNumber(
        unit='N m', low=0.0, high=1e3, stage=Stage.SENSING,
        meaning="noise (rms) of the motor's torque",
    ),
    'effort_resolution': PlantNumber(
        unit='N m', low=0.0, high=1e3, stage=Stage.SENSING, meaning='its step',
    ),
}  # fmt: skip
"""Of each key of joints and sensors.

A wire of 1 mm breaks at about 1 kN, and one of 20 mm length and 1 mm2 stiffens to E A / L = 1e7 N/m
(steel, E = 2e11 Pa). A pulley finer than the wire, or one of 0.2 m, is none. An exponent of 10 is
friction of 1 over one and a half turns and passes 1/22000 of the tension. Joint and motor are
bounded by a finger's moment (10 N m) and by servos between 0.02 Hz and 1.6 kHz; a sensor's
resolution by what it measures at most.
"""
