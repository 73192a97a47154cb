"""Places of numbers in the flat arrays that the compiled physics works on.

Every nominal parameter, effect parameter and state has one fixed index, handed out here while the
modules are imported; numba then compiles the indices in as constants. An effect that is off costs
one test of a flag.
"""

from endoscope_core.physics.sheath import TABLE_ROWS, wire_states

PROFILE_TERMS = 8
"""Most coefficients that a friction profile can have."""

_NOMINAL: list[str] = []


def _nominal(key: str) -> int:
    """Index of a nominal parameter of one number."""
    _NOMINAL.append(key)
    return len(_NOMINAL) - 1


PRETENSION = _nominal('pretension')
PRETENSION_PROFILE = _nominal('pretension_profile')
WIRE_STIFFNESS = _nominal('wire_stiffness')
PULLEY_RADIUS = _nominal('pulley_radius')
JOINT_RADIUS = _nominal('joint_radius')
CAPSTAN_EXPONENT = _nominal('capstan_exponent')
JOINT_STIFFNESS = _nominal('joint_stiffness')
JOINT_REST_ANGLE = _nominal('joint_rest_angle')
JOINT_FRICTION = _nominal('joint_friction')
JOINT_PRESLIDING = _nominal('joint_presliding')
JOINT_PRESLIDING_SPREAD = _nominal('joint_presliding_spread')
SECTION_FRICTION = _nominal('section_friction')
SECTION_STRAIGHT_ANGLE = _nominal('section_straight_angle')
JOINT_DAMPING = _nominal('joint_damping')
MOTOR_BANDWIDTH = _nominal('motor_bandwidth')
MOTOR_DAMPING_RATIO = _nominal('motor_damping_ratio')
NOMINAL_KEYS = tuple(_NOMINAL)
"""In the order of their indices; `friction_profile` follows them."""
FRICTION_PROFILE = len(NOMINAL_KEYS)

CELLS = 32
"""Cells of a wire."""
ELEMENTS = 3
"""Dahl elements that make up the joint's friction."""


class Slots:
    """Hands out consecutive indices of the flag, parameter and state arrays."""

    def __init__(self) -> None:
        self.flags = 0
        self.parameters = FRICTION_PROFILE + PROFILE_TERMS
        self.states = 0
        self.shaft_angles: list[int] = []  # states that begin at the shaft's angle

    def flag(self) -> int:
        """Index of the next effect's on/off flag."""
        self.flags += 1
        return self.flags - 1

    def parameter_block(self, count: int) -> int:
        """First of `count` consecutive parameter indices."""
        self.parameters += count
        return self.parameters - count

    def state_block(self, count: int = 1) -> int:
        """First of `count` consecutive state indices."""
        self.states += count
        return self.states - count

    def shaft_angle(self) -> int:
        """Index of a state that begins at the motor shaft's angle."""
        self.shaft_angles.append(self.state_block())
        return self.shaft_angles[-1]


SLOTS = Slots()

TICKS = SLOTS.state_block()
"""Ticks since the start."""
MOTOR = SLOTS.shaft_angle()
"""Motor shaft, rad."""
MOTOR_SPEED = SLOTS.state_block()
PULLEY = SLOTS.shaft_angle()
"""Pulley, rad: the shaft behind what lies between them."""
TRAVEL = SLOTS.state_block(2)
"""By how much the pulley has wound up each wire, m."""
EXTRA_LENGTH = SLOTS.state_block(2)
"""What effects have added to each wire's length, m."""
REST_TENSION = SLOTS.state_block()
"""Mean tension of a wire as it was tightened, N."""
JOINT = SLOTS.state_block()
"""Bending angle of the joint, rad."""
JOINT_STEP = SLOTS.state_block()
"""By how much it bent in the last tick, rad."""
TIP = SLOTS.state_block()
"""Bending angle of the tip, rad."""
JOINT_SLIDE = SLOTS.state_block(ELEMENTS)
"""Dahl states of the joint's friction."""
SLIDING_SPEED = SLOTS.state_block()
"""Speed at which the positive wire slid towards the motor in the last tick, m/s."""
WINDING_SPEED = SLOTS.state_block()
"""Speed at which the pulley wound up the positive wire in the last tick, m/s."""
FALLING_FACTOR = SLOTS.state_block()
RISING_FACTOR = SLOTS.state_block()
"""Factors on the capstan exponent that the table of shapes holds."""
FLOOR = SLOTS.state_block()
"""What load-independent friction adds to every node's tension, N."""
TRANSITION = SLOTS.state_block(4)
"""Exact transition of the servo over a tick."""
EXTRA_END_LENGTH = SLOTS.state_block()
"""What the other joint has added to the displacement of the positive wire at the joint, m."""
FILM = SLOTS.state_block(2)
"""Viscous drag on each wire, half of it at either end, N."""
WIRE_A = SLOTS.state_block(wire_states(CELLS))
WIRE_B = SLOTS.state_block(wire_states(CELLS))
PATH = SLOTS.state_block()
"""Distance that the wires have slid, m; as the next two, only where a place has a function."""
MEAN_TENSION = SLOTS.state_block()
"""Of both wires, N."""
TENSION_DIFFERENCE = SLOTS.state_block()
"""Mean tension of the positive wire less that of the negative one, N."""
LAGGED_LOAD = SLOTS.state_block(2)
"""Mean tension of each wire as it was a while ago, N; as the next two, only where a place has a
function."""
LAGGED_SPEED = SLOTS.state_block()
"""Sliding speed as it was a while ago, m/s."""
LAGGED_ANGLE = SLOTS.state_block()
"""Joint's angle as it was a while ago, rad."""
NOW = SLOTS.state_block()
"""Time in the middle of the tick, s."""
OTHER = SLOTS.state_block()
"""The other joint's angle in the tick, rad."""

# Rows of the arrays of a joint's sheath, (SHEATH_ROWS, CELLS + 1).
# The table of shapes comes first.
PLACES, EXPONENTS, WORK = range(TABLE_ROWS, TABLE_ROWS + 3)
SHEATH_ROWS = TABLE_ROWS + 5

HISTORY = 1024
"""Ticks that are kept for delays, in each row of a joint's history."""
COMMAND_HISTORY, ANGLE_HISTORY, TENSION_HISTORY = 0, 1, 2
"""Rows of the command and of the tip's angle in rad, and the first of both wires' tensions in N."""
HISTORIES = 4

IN_COMMAND, IN_OTHER_JOINT, IN_MOTOR = range(3)
INPUTS = 3
"""Columns of the input: command and measured motor angle (NaN: let the servo run) in rad of the
shaft, and the other joint's angle in rad."""

OUT_MOTOR, OUT_MOTOR_SPEED, OUT_EFFORT, OUT_TENSION_A, OUT_TENSION_B, OUT_BENDING, OUT_JOINT = (
    range(7)
)
OUTPUTS = 7
