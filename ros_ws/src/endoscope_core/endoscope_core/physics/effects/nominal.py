"""Physics of the nominal plant, as what a plant may lack and a search may find."""

from typing import Any

from endoscope_core.physics.description import NUMBERS, SLAVE
from endoscope_core.physics.effect import NominalPhysics, Parameter, Stage, Traits

RIGID = 1e7
"""N/m: a wire that does not stretch."""
AT_ONCE = 1e4
"""Rad/s: a servo that is where it is sent within a tick."""


def _searched(key: str, low: float, high: float, **more: Any) -> Parameter:
    """A nominal parameter with the bounds of a search; `more` as in `Parameter`."""
    return Parameter(key, NUMBERS[key].unit, low, high, getattr(SLAVE, key), **more)


NominalPhysics(
    'servo_lag',
    Stage.ACTUATOR,
    1,
    physics='The servo follows its command as a system of second order.',
    equation="m'' = motor_bandwidth^2 (u - m) - 2 motor_damping_ratio motor_bandwidth m'",
    source='Ogata, Modern Control Engineering, 5th ed. 2010, sec. 5-3',
    parameters=(
        _searched(
            'motor_bandwidth', 1.0, AT_ONCE, off=AT_ONCE, starts=(10.0, 30.0, 90.0), scale=1.0
        ),
        _searched('motor_damping_ratio', 0.1, 5.0),
    ),
)
NominalPhysics(
    'wire_pretension',
    Stage.TRANSMISSION,
    2,
    physics='The wires are tightened before the start.',
    equation='T = pretension at the motor, before the start',
    source='Kaneko et al., IEEE ICRA 1991',
    parameters=(_searched('pretension', 0.0, 50.0, off=0.0, starts=(2.0, 5.0, 12.0), scale=2.0),),
)
NominalPhysics(
    'wire_stretch',
    Stage.TRANSMISSION,
    3,
    physics='The wires stretch under their tension.',
    equation='T = wire_stiffness (travel at the motor - travel at the joint)',
    source='Palli, Melchiorri, IEEE ICRA 2006',
    parameters=(
        _searched(
            'wire_stiffness', 50.0, RIGID, off=RIGID, starts=(1000.0, 3000.0, 10000.0), scale=1.0
        ),
    ),
)
NominalPhysics(
    'sheath_friction',
    Stage.TRANSMISSION,
    4,
    physics='The sheath takes tension from a sliding wire, in proportion to it, along its length.',
    equation='T(s) = T(0) exp(-capstan_exponent s), s from 0 to 1 along the sheath',
    source='Kaneko et al., IEEE ICRA 1991',
    parameters=(
        _searched('capstan_exponent', 0.0, 6.0, off=0.0, starts=(0.3, 0.9, 2.0), scale=0.3),
    ),
)
NominalPhysics(
    'bending_stiffness',
    Stage.JOINT,
    1,
    physics='The bending section is elastic.',
    equation='moment = -joint_stiffness (q - joint_rest_angle)',
    source='Webster, Jones, International Journal of Robotics Research 29(13), 2010',
    parameters=(
        _searched(
            'joint_stiffness', 0.0, 1.0, off=0.0, starts=(0.002, 0.0045, 0.012), scale=0.0045
        ),
    ),
)
NominalPhysics(
    'bending_friction',
    Stage.JOINT,
    2,
    physics='The bending section has friction, which builds up with displacement.',
    equation='moment = -joint_friction z, dz/dq = (sign(dq) - z) / joint_presliding',
    source='Dahl, Aerospace Corp. TOR-0158(3107-18)-1, 1968',
    parameters=(
        _searched('joint_friction', 0.0, 0.1, off=0.0, starts=(3e-4, 9e-4, 2.7e-3), scale=9e-4),
        _searched('joint_presliding', 1e-3, 1.0),
    ),
)
NominalPhysics(
    'section_friction',
    Stage.JOINT,
    3,
    physics='The bending section takes tension from the wire on the inside of its bend, the more '
    'the further it is bent.',
    equation='moment = +-r T (1 - exp(-section_friction (q - section_straight_angle) z)), T of the '
    'wire inside, r = joint_radius, z as of the friction of the joint',
    source='Kaneko et al., IEEE ICRA 1991; Feliu-Talegon et al. 2025',
    parameters=(
        _searched('section_friction', 0.0, 3.0, off=0.0, starts=(0.1, 0.3, 0.9), scale=0.3),
        _searched('section_straight_angle', -1.0, 1.0),
    ),
    traits=Traits(families=('joint_friction_of_angle',)),
    in_every_rig=False,
)
