"""Places of numbers in the flat arrays that the compiled physics works on.

Every nominal parameter, effect parameter and state has one fixed index, handed out here while the
modules are imported; numba then compiles the indices in as constants. An effect that is off costs
one test of a flag.
"""

NOMINAL_KEYS = (
    'pretension',
    'wire_stiffness',
    'joint_radius',
    'pulley_radius',
    'capstan_exponent',
    'presliding_distance',
    'joint_stiffness',
    'joint_damping',
    'joint_friction',
    'joint_presliding',
    'motor_bandwidth',
    'motor_damping_ratio',
)
"""Fields of `JointParameters` in order; named here too because the plant imports the effects."""


class SlotAllocator:
    """Hands out consecutive indices of the flag, parameter and state arrays."""

    def __init__(self) -> None:
        self.flags = 0
        self.parameters = len(NOMINAL_KEYS)
        self.states = 0
        self.resting_angles: list[int] = []

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

    def angle_state(self) -> int:
        """Index of a state that rests at the joint-equivalent angle where the rig rests."""
        self.resting_angles.append(self.state_block())
        return self.resting_angles[-1]


SLOTS = SlotAllocator()

START_FRICTION = SLOTS.parameter_block(1)
"""Share of the sheath's friction that holds both wires at rest, as tightening them from the motor's
side leaves it: how a rig begins rather than what it is, and no key of a plant file."""

PRETENSION = NOMINAL_KEYS.index('pretension')
WIRE_STIFFNESS = NOMINAL_KEYS.index('wire_stiffness')
JOINT_RADIUS = NOMINAL_KEYS.index('joint_radius')
PULLEY_RADIUS = NOMINAL_KEYS.index('pulley_radius')
CAPSTAN_EXPONENT = NOMINAL_KEYS.index('capstan_exponent')
PRESLIDING_DISTANCE = NOMINAL_KEYS.index('presliding_distance')
JOINT_STIFFNESS = NOMINAL_KEYS.index('joint_stiffness')
JOINT_DAMPING = NOMINAL_KEYS.index('joint_damping')
JOINT_FRICTION = NOMINAL_KEYS.index('joint_friction')
JOINT_PRESLIDING = NOMINAL_KEYS.index('joint_presliding')
MOTOR_BANDWIDTH = NOMINAL_KEYS.index('motor_bandwidth')
MOTOR_DAMPING_RATIO = NOMINAL_KEYS.index('motor_damping_ratio')

TICKS = SLOTS.state_block()
MOTOR = SLOTS.angle_state()
MOTOR_SPEED = SLOTS.state_block()
JOINT = SLOTS.angle_state()
JOINT_SPEED = SLOTS.state_block()
SLIDE_A = SLOTS.state_block()
SLIDE_B = SLOTS.state_block()
JOINT_SLIDE = SLOTS.state_block()
PULLEY = SLOTS.angle_state()
PULLEY_SPEED = SLOTS.state_block()
WIRE_END = SLOTS.angle_state()
WIRE_END_SPEED = SLOTS.state_block()
TIP = SLOTS.angle_state()
TENSION_A = SLOTS.state_block()
TENSION_B = SLOTS.state_block()

HISTORY = 1024
"""Ticks of command and of angle that are kept for delays."""
COMMAND_HISTORY = 0
ANGLE_HISTORY = 1
