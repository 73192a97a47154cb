"""What a plant is made of: frozen parameter sets with their nominal values.

The nominal plant is a pair of wires for each bending joint with capstan friction all along their
sheaths (Kaneko et al., IEEE ICRA 1991; Palli, Melchiorri, IEEE ICRA 2006), and a joint with Dahl
friction (Aerospace Corp. TOR-0158(3107-18)-1, 1968).
"""

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from enum import StrEnum
from typing import Any

from endoscope_core.physics.effect import Stage
from endoscope_core.physics.layout import PROFILE_TERMS
from endoscope_core.schema import Number


class Keeper(StrEnum):
    """What keeps a number from one recording of a rig to the next."""

    DEVICE = 'device'  # one number, whatever the tube
    JOINT = 'joint'  # scatters a little from one shape of the tube to the next
    SHAPE = 'shape'  # of the tube: another one in each


@dataclass(frozen=True, kw_only=True)
class PlantNumber:
    """What is known of one key of a plant beside its nominal value, in SI units.

    A healthy rig's number is the described one but for a factor (`scaled`), or is off by `spread`
    (rms).
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


_ROW = 'number'
_MACHINED = 2.5e-5 / math.sqrt(3.0)
"""Rms in m of a radius as machined: diameters to 6 mm without a tolerance of their own keep 0.05 mm
(ISO 2768-1, class fine), and are taken to lie anywhere within it (GUM, 4.3.7)."""


def _number(
    nominal: Any, unit: str, meaning: str, low: float, high: float, stage: Stage, **known: Any
) -> Any:
    """A field of a plant with its row of the table."""
    known |= {'unit': unit, 'meaning': meaning, 'low': low, 'high': high, 'stage': stage}
    return field(default=nominal, metadata={_ROW: PlantNumber(**known)})


# What bounds the numbers of the tables below:
# A wire of 1 mm breaks at about 1 kN, and one of 20 mm length and 1 mm2 stiffens to E A / L =
# 1e7 N/m (steel, E = 2e11 Pa). A pulley finer than the wire, or one of 0.2 m, is none. An
# exponent of 10 is friction of 1 over one and a half turns and passes 1/22000 of the tension.
# Joint and motor are bounded by a finger's moment (10 N m) and by servos between 0.02 Hz and
# 1.6 kHz; a sensor's resolution by what it measures at most.


@dataclass(frozen=True)
class JointParameters:
    """One bending joint with its antagonistic pair of wires and its servo (SI units).

    Each wire is tightened to T = pretension exp(-pretension_profile phi), phi the capstan exponent
    from the motor to a place, whose share along the wire is proportional to
    exp(sum of friction_profile[j] cos((j + 1) pi s)), s from 0 at the motor to 1 at the joint. With
    joint_presliding_spread s the joint has three equal elements with pre-sliding angles qs exp(-s),
    qs and qs exp(s). Of the tension T of the wire on the inside of its bend the section lets
    T exp(-section_friction abs(q - section_straight_angle)) act where that wire is pulled, and
    T exp(+...) where it is let go. The wires are tightened at angle zero, where friction holds the
    joint. ValueError if a value is out of its bounds in physics, or the profile has too many terms.
    """

    # fmt: off
    pretension: float = _number(
        5.0, 'N', 'tension of each wire at the motor before the start',
        0.0, 1e3, Stage.TRANSMISSION, scaled=True,
    )
    pretension_profile: float = _number(
        0.75, '', 'how the wires were tightened: 1 from the motor, 0 evenly, -1 to 1',
        -1.0, 1.0, Stage.TRANSMISSION, spread=0.25, keeper=Keeper.SHAPE,
    )
    wire_stiffness: float = _number(
        3000.0, 'N/m', 'stiffness of a whole wire',
        1.0, 1e7, Stage.TRANSMISSION, endless=True, scaled=True,
    )
    pulley_radius: float = _number(
        0.0024, 'm', 'radius at which the wires are wound at the motor',
        1e-4, 0.1, Stage.TRANSMISSION, spread=_MACHINED, keeper=Keeper.DEVICE,
    )
    joint_radius: float = _number(
        0.0008, 'm', 'radius at which the wires act on the joint',
        1e-4, 0.1, Stage.TRANSMISSION, spread=_MACHINED, keeper=Keeper.DEVICE,
    )
    capstan_exponent: float = _number(
        0.9, '', 'friction times the bend of the whole sheath; what its shape changes',
        0.0, 10.0, Stage.TRANSMISSION, scaled=True, keeper=Keeper.SHAPE,
    )
    joint_stiffness: float = _number(
        0.0045, 'N m/rad', 'elastic moment of the bending section',
        0.0, 10.0, Stage.JOINT, scaled=True,
    )
    joint_rest_angle: float = _number(
        0.0, 'rad', 'angle at which the bending section rests without wires',
        -math.pi, math.pi, Stage.JOINT, spread=0.05, keeper=Keeper.SHAPE,
    )
    joint_friction: float = _number(
        9.0e-4, 'N m', 'Dahl friction of the joint',
        0.0, 10.0, Stage.JOINT, scaled=True,
    )
    joint_presliding: float = _number(
        0.03, 'rad', 'angle over which that friction builds up',
        1e-5, math.pi, Stage.JOINT, scaled=True,
    )
    joint_presliding_spread: float = _number(
        0.0, '', 'spread of three such angles, 0 for one',
        0.0, 5.0, Stage.JOINT, spread=0.5,
    )
    section_friction: float = _number(
        0.0, '1/rad', 'capstan friction of the bending section on the wire inside its bend',
        0.0, 10.0, Stage.JOINT, scaled=True,
    )
    section_straight_angle: float = _number(
        0.0, 'rad', 'angle at which the section is straight and has none of that friction',
        -math.pi, math.pi, Stage.JOINT, spread=0.05, keeper=Keeper.DEVICE,
    )
    joint_damping: float = _number(
        1.0e-5, 'N m s/rad', 'viscous moment of the bending section',
        1e-7, 10.0, Stage.JOINT, scaled=True,
    )
    motor_bandwidth: float = _number(
        30.0, 'rad/s', "natural frequency of the servo's position loop",
        0.1, 1e4, Stage.ACTUATOR, endless=True, scaled=True, keeper=Keeper.DEVICE,
    )
    motor_damping_ratio: float = _number(
        0.9, '', 'its damping ratio',
        0.01, 100.0, Stage.ACTUATOR, scaled=True, keeper=Keeper.DEVICE,
    )
    friction_profile: tuple[float, ...] = _number(
        (), '', 'how friction is spread along the wire: cosine coefficients, [] evenly',
        -5.0, 5.0, Stage.TRANSMISSION, spread=0.5, keeper=Keeper.SHAPE,
    )
    # fmt: on

    def __post_init__(self) -> None:
        _check_numbers(self)
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

    ValueError if a value is not finite, negative, or a rate or count is zero.
    """

    # fmt: off
    load_cell_noise: float = _number(
        0.02, 'N', 'noise (rms) of the load cells',
        0.0, 1e3, Stage.SENSING,
    )
    load_cell_resolution: float = _number(
        0.002, 'N', 'their step',
        0.0, 1e3, Stage.SENSING,
    )
    load_cell_rate: float = _number(
        1000.0, 'Hz', 'their rate, and that of the motors where a bag has none',
        0.1, 1e5, Stage.SENSING,
    )
    tracker_noise: float = _number(
        0.00436, 'rad', 'noise (rms) of the bending angle from the tracker',
        0.0, math.pi, Stage.SENSING,
    )
    tracker_rate: float = _number(
        40.0, 'Hz', 'its rate',
        0.1, 1e5, Stage.SENSING,
    )
    encoder_counts: float = _number(
        4096.0, 'counts a turn', "of the motor's encoder",
        1.0, 2.0**32, Stage.SENSING,
    )
    velocity_resolution: float = _number(
        0.02397, 'rad/s', "step of the motor's velocity",
        0.0, 1e3, Stage.SENSING,
    )
    effort_noise: float = _number(
        0.0015, 'N m', "noise (rms) of the motor's torque",
        0.0, 1e3, Stage.SENSING,
    )
    effort_resolution: float = _number(
        0.0046, 'N m', 'its step',
        0.0, 1e3, Stage.SENSING,
    )
    # fmt: on

    def __post_init__(self) -> None:
        _check_numbers(self)


NUMBERS: Mapping[str, PlantNumber] = {
    each.name: each.metadata[_ROW]
    for kind in (JointParameters, SensorParameters)
    for each in fields(kind)
}
"""Rows of all keys of joints and sensors."""


@dataclass(frozen=True)
class EffectSpec:
    """One physical effect added to the nominal plant, its parameters in SI units."""

    id: str  # in the catalogue of effects
    joint: str  # that it acts on
    # In SI units; those left out take the effect's typical value.
    parameters: Mapping[str, Number] = field(default_factory=dict)


@dataclass(frozen=True)
class TermSpec:
    """A function of one state added to the nominal plant where the catalogue has no effect."""

    joint: str  # that it acts on
    place: str  # in the table of places
    expression: str = ''  # formula of the place's symbol, or nothing
    values: tuple[float, ...] = ()  # instead: at equally spaced nodes over the range
    # Of the argument, by default the place's; beyond it the function keeps its last value, or
    # begins again.
    range: tuple[float, float] | None = None
    # Whether it is no term of its own: what other functions add where this one acts is multiplied
    # by one plus this one. Both together are a function of two states.
    multiplies: bool = False
    # Time constant in s of an argument that lags, by default the place's.
    lag_s: float | None = None


@dataclass(frozen=True)
class PlantDescription:
    """A whole rig: its joints in order, its sensors, and the physics added to the nominal plant.

    `effects` are of the catalogue, `terms` are functions where it has none.
    """

    # By default both of the simulated slave.
    joints: Mapping[str, JointParameters] = field(
        default_factory=lambda: {'bend_x': SLAVE, 'bend_y': SLAVE}
    )
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


def _check_numbers(parameters: JointParameters | SensorParameters) -> None:
    for key, value in vars(parameters).items():
        if isinstance(value, tuple):
            continue
        if not math.isfinite(value):
            raise ValueError(f'{key} is {value}: give a finite number')
        low = NUMBERS[key].low
        if low >= 0.0 and (value < 0.0 or (value == 0.0 and low > 0.0)):
            raise ValueError(f'{key} is {value}: it must be positive')


SLAVE: JointParameters = JointParameters(joint_friction=5.0e-4, section_friction=0.3)
"""A joint of the simulated slave: some of its friction grows with the bend, as on the real
endoscope. A joint of which nothing is said has none of that."""
