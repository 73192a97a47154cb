"""What a plant is made of: frozen parameter sets with their nominal values.

The nominal plant is a pair of wires for each bending joint with capstan friction all along their
sheaths (Kaneko et al., IEEE ICRA 1991; Palli, Melchiorri, IEEE ICRA 2006), and a joint with Dahl
friction (Aerospace Corp. TOR-0158(3107-18)-1, 1968).
"""

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from endoscope_core.physics.layout import PROFILE_TERMS
from endoscope_core.schema import Number


@dataclass(frozen=True)
class JointParameters:
    """One bending joint with its antagonistic pair of wires and its servo (SI units).

    Attributes
    ----------
    pretension : float
        Tension T0 of each wire at the motor before the start, N.
    pretension_profile : float
        How the wires were tightened: T0 exp(-pretension_profile phi) along the sheath; 1 from the
        motor's side, 0 evenly.
    wire_stiffness : float
        Stiffness k of a whole wire in N/m.
    pulley_radius, joint_radius : float
        Radii in m at which the wires are wound at the motor, and act on the joint.
    capstan_exponent : float
        Exponent Phi = mu Theta of the whole sheath; what the tube's shape changes.
    friction_profile : tuple of float
        Coefficients c_j by which the share of the exponent along the wire is proportional to
        exp(sum c_j cos(j pi s)), s from 0 at the motor to 1 at the joint.
    joint_stiffness, joint_damping : float
        Elastic moment K in N m/rad and viscous moment c in N m s/rad of the bending section.
    joint_rest_angle : float
        Angle q0 in rad at which the bending section is at rest without wires; they are tightened at
        angle zero, where friction holds it.
    joint_friction, joint_presliding : float
        Dahl friction tau_f in N m of the joint and its pre-sliding angle qs in rad.
    joint_presliding_spread : float
        s of three equal elements with pre-sliding angles qs exp(-s), qs and qs exp(s).
    motor_bandwidth, motor_damping_ratio : float
        Natural frequency wm in rad/s and damping ratio of the servo's position loop.

    Raises
    ------
    ValueError
        If a value is not finite, out of its bounds in physics, or the profile has too many terms.
    """

    pretension: float = 5.0
    pretension_profile: float = 0.75
    wire_stiffness: float = 3000.0
    pulley_radius: float = 0.0024
    joint_radius: float = 0.0008
    capstan_exponent: float = 0.9
    joint_stiffness: float = 0.0045
    joint_rest_angle: float = 0.0
    joint_friction: float = 9.0e-4
    joint_presliding: float = 0.03
    joint_presliding_spread: float = 0.0
    joint_damping: float = 1.0e-5
    motor_bandwidth: float = 30.0
    motor_damping_ratio: float = 0.9
    friction_profile: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        may_be_zero = {
            'pretension',
            'capstan_exponent',
            'joint_friction',
            'joint_stiffness',
            'joint_presliding_spread',
        }
        signed = {'joint_rest_angle', 'pretension_profile'}
        _check_numbers(self, may_be_zero, signed)
        if abs(self.pretension_profile) > 1.0:
            raise ValueError(
                f'pretension_profile is {self.pretension_profile}: friction holds -1 to 1'
            )
        if len(self.friction_profile) > PROFILE_TERMS:
            raise ValueError(
                f'friction_profile has {len(self.friction_profile)} coefficients: give '
                f'{PROFILE_TERMS} at most'
            )
        for value in self.friction_profile:
            if not math.isfinite(value):
                raise ValueError(f'friction_profile has {value}: give finite numbers')


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
        _check_numbers(self, may_be_zero, set())


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
    parameters: Mapping[str, Number] = field(default_factory=dict)


@dataclass(frozen=True)
class TermSpec:
    """A function of one state added to the nominal plant where the catalogue has no effect.

    Attributes
    ----------
    joint : str
        The joint it acts on.
    place : str
        Name in the table of places.
    expression : str
        Formula of the place's symbol, or nothing.
    values : tuple of float
        Instead of a formula: the function at equally spaced nodes over the range.
    range : (float, float), optional
        Of the argument; beyond it the function keeps its last value, or begins again. That of the
        place if not given.
    multiplies : bool
        Whether it is no term of its own: what other functions add where this one acts is multiplied
        by one plus this one. Both together are a function of two states.
    lag_s : float, optional
        Time constant in s of an argument that lags; that of the place if not given.
    """

    joint: str
    place: str
    expression: str = ''
    values: tuple[float, ...] = ()
    range: tuple[float, float] | None = None
    multiplies: bool = False
    lag_s: float | None = None


def nominal_joints() -> dict[str, JointParameters]:
    """Both joints of the nominal rig."""
    return {'bend_x': JointParameters(), 'bend_y': JointParameters()}


@dataclass(frozen=True)
class PlantDescription:
    """A whole rig: its joints in order, its sensors, and the physics added to the nominal plant.

    `effects` are of the catalogue, `terms` are functions where it has none.
    """

    joints: Mapping[str, JointParameters] = field(default_factory=nominal_joints)
    sensors: SensorParameters = field(default_factory=SensorParameters)
    effects: tuple[EffectSpec, ...] = ()
    terms: tuple[TermSpec, ...] = ()

    def of_joints(self, names: Iterable[str]) -> 'PlantDescription':
        """The plant with those of its joints only, in their order, and what was added to them."""
        joints = {name: self.joints[name] for name in names}
        return dataclasses.replace(
            self,
            joints=joints,
            effects=tuple(spec for spec in self.effects if spec.joint in joints),
            terms=tuple(term for term in self.terms if term.joint in joints),
        )

    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of every array of the simulator."""
        return tuple(self.joints)


def _check_numbers(
    parameters: JointParameters | SensorParameters, may_be_zero: set[str], signed: set[str]
) -> None:
    for item in dataclasses.fields(parameters):
        value = getattr(parameters, item.name)
        if isinstance(value, tuple):
            continue
        if not math.isfinite(value):
            raise ValueError(f'{item.name} is {value}: give a finite number')
        if item.name in signed:
            continue
        if value < 0 or (value == 0 and item.name not in may_be_zero):
            raise ValueError(f'{item.name} is {value}: it must be positive')
