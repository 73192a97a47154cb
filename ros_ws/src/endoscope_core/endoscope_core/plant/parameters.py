"""What a plant is made of: frozen parameter sets with their nominal values.

The symbols, keys and nominal values are those of the nominal tendon-sheath plant: capstan
friction (Euler-Eytelwein; Kaneko et al., IEEE ICRA 1991) with Dahl pre-sliding (Dahl, Aerospace
Corp. TOR-0158(3107-18)-1, 1968) on an antagonistic pair of wires for each bending joint.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class JointParameters:
    """One bending joint with its antagonistic pair of wires and its servo (SI units).

    Attributes
    ----------
    pretension : float
        Mean wire tension T0 in N.
    wire_stiffness : float
        Stiffness k of one wire in N/m.
    joint_radius, pulley_radius : float
        Radii in m at which the wires act on the joint, and are wound at the motor.
    capstan_exponent : float
        Total exponent phi = mu * Theta of the sheath; what the tube's shape changes.
    presliding_distance : float
        Dahl pre-sliding distance xs of the wires in m.
    joint_stiffness, joint_damping : float
        Elastic moment K in N m/rad and viscous moment c in N m s/rad of the bending section.
    joint_friction, joint_presliding : float
        Dahl friction tau_f in N m of the joint and its pre-sliding angle qs in rad.
    motor_bandwidth, motor_damping_ratio : float
        Natural frequency wm in rad/s and damping ratio of the servo's position loop.

    Raises
    ------
    ValueError
        If a value is not finite, or not positive where physics needs it positive.
    """

    pretension: float = 5.0
    wire_stiffness: float = 2000.0
    joint_radius: float = 0.0025
    pulley_radius: float = 0.005
    capstan_exponent: float = 0.9
    presliding_distance: float = 1.0e-4
    joint_stiffness: float = 0.003
    joint_damping: float = 3.0e-4
    joint_friction: float = 0.004
    joint_presliding: float = 0.02
    motor_bandwidth: float = 60.0
    motor_damping_ratio: float = 0.9

    def __post_init__(self) -> None:
        may_be_zero = {'capstan_exponent', 'joint_friction', 'joint_stiffness', 'pretension'}
        _check_numbers(self, may_be_zero)

    @property
    def gear(self) -> float:
        """Motor shaft angle for one radian of joint-equivalent angle."""
        return self.joint_radius / self.pulley_radius


@dataclass(frozen=True)
class SensorParameters:
    """Noise (rms), resolution and rate of the sensors of the rig (SI units).

    Raises
    ------
    ValueError
        If a value is not finite, negative, or a rate or count is zero.
    """

    load_cell_noise: float = 0.02
    load_cell_resolution: float = 0.002
    load_cell_rate: float = 1000.0
    tracker_noise: float = 0.00436
    tracker_rate: float = 40.0
    encoder_counts: float = 4096.0
    velocity_resolution: float = 0.02397
    effort_noise: float = 0.0015
    effort_resolution: float = 0.0046

    def __post_init__(self) -> None:
        positive = {'load_cell_rate', 'tracker_rate', 'encoder_counts'}
        may_be_zero = {f.name for f in dataclasses.fields(self)} - positive
        _check_numbers(self, may_be_zero)


@dataclass(frozen=True)
class EffectSpec:
    """One physical effect added to the nominal plant.

    Attributes
    ----------
    id : str
        Name in the catalogue of effects.
    joint : str
        The joint it acts on.
    parameters : Mapping[str, float]
        Parameters in SI units; those left out take the effect's typical value.
    """

    id: str
    joint: str
    parameters: Mapping[str, float] = field(default_factory=dict)


def nominal_joints() -> dict[str, JointParameters]:
    """Both joints of the nominal rig."""
    return {'bend_x': JointParameters(), 'bend_y': JointParameters()}


@dataclass(frozen=True)
class PlantDescription:
    """A whole rig: its joints in order, its sensors, and the physics added to the nominal plant."""

    joints: Mapping[str, JointParameters] = field(default_factory=nominal_joints)
    sensors: SensorParameters = field(default_factory=SensorParameters)
    effects: tuple[EffectSpec, ...] = ()

    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of every array of the simulator."""
        return tuple(self.joints)


def _check_numbers(parameters: JointParameters | SensorParameters, may_be_zero: set[str]) -> None:
    for item in dataclasses.fields(parameters):
        value = getattr(parameters, item.name)
        if not math.isfinite(value):
            raise ValueError(f'{item.name} is {value}: give a finite number')
        if value < 0 or (value == 0 and item.name not in may_be_zero):
            raise ValueError(f'{item.name} is {value}: it must be positive')
