"""The places of the chain at which a smooth function of one state can be added.

What the wires' tension, the distance slid and the joint's own angle do to a wire acts a tick late:
nothing that they change is then part of the tick's own balance.
"""

import math
from dataclasses import KW_ONLY, dataclass
from enum import StrEnum
from typing import Any

from endoscope_core.errors import InputError, nearest
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits, in_order_of_chain
from endoscope_core.physics.functions.states import (
    angle_less_lagged,
    angular_speed,
    both_tensions,
    lagged_speed,
    lagged_tension,
    now,
    opposite,
    other_angle,
    own_angle,
    path,
    per_tick,
    tension_difference,
    unit_slope,
)
from endoscope_core.physics.hooks import (
    COMMAND,
    EFFORT,
    END_LENGTH,
    EXPONENT,
    FILM_DRAG,
    JOINT_FRICTION_FACTOR,
    LENGTH,
    LOAD,
    LOAD_CELL,
    PULLEY_ANGLE,
    SERVO_ERROR,
    STIFFNESS,
    TRACKER,
    TRAVEL_OF,
    Fold,
    Function,
    Hook,
)

NODES = 41
"""Values of a function: a triangle wave of one period over its range, the worst of the common laws,
is then off by less than 2 % of what it spans wherever its corners lie (a test measures it)."""
LOW, HIGH, VALUES = 0, 1, 2
"""Places of the range's ends and of the first value within the function's block of parameters."""
LAG = VALUES + NODES
"""Place of the time constant of an argument that lags."""
LAGS_S = (0.05, 60.0)
"""Time constants in s of arguments that lag: from ten long ticks to a minute."""
LARGEST_SHARE = 3.0
"""By how many times itself a function may be larger, or smaller, by one that multiplies it."""
SOURCE = (
    'Missing physics as a smooth function within the simulator: Heiden et al., NeuralSim, IEEE '
    'ICRA 2021; Kennedy, OHagan, J. R. Stat. Soc. B 63, 2001'
)


class Shape(StrEnum):
    """What kind of function of its argument a place takes."""

    ANY = 'any'
    ODD = 'odd'
    EVEN = 'even'
    PERIODIC = 'periodic'


@dataclass(frozen=True)
class Argument:
    """The state that a function depends on."""

    symbol: str  # in an expression
    words: str
    unit: str
    # Range of the table where nobody gives one.
    low: float
    high: float
    # It follows a state of the plant as a first-order lag does, with a time constant of its own:
    # what nobody sees (Kelvin-Voigt: Findley, Lai, Onaran, Creep and Relaxation, 1976).
    lags: bool = False
    kept_up: bool = False  # a state that nothing but functions depends on

    @property
    def follows(self) -> bool:
        """Whether a state has to be advanced for it alone."""
        return self.lags or self.kept_up


@dataclass(frozen=True)
class Place(Effect):
    """A smooth function of one state at a place of the chain; no effect of the catalogue.

    `at`, `sign` and `by_step` are compiled functions that take some of the hook's arguments, by
    their names; `at` may be the name of one of them.
    """

    _: KW_ONLY
    hook: Hook  # where it acts; a factor is the exponential of the function, all else is added
    argument: Argument
    at: Function | str  # the argument
    unit: str  # of the function
    largest: float  # absolute value that the function may have
    shape: Shape = Shape.ANY
    from_zero: bool = False  # its value at zero, where wires are tightened, is taken away
    never_negative: bool = False  # below zero it would give energy to the plant without end
    cell: int | None = None  # whose reading it is, of those that a hook is for
    sign: Function | None = None  # factor on it
    by_step: Function | None = None  # slope of the argument by the joint's step, for hooks that ask

    def largest_of(self, multiplies: bool) -> float:
        """Largest absolute value of a function that is added, or of one that multiplies."""
        return LARGEST_SHARE if multiplies else self.largest

    @property
    def point(self) -> tuple[str, int | None]:
        """Point of the chain whose functions multiply one another: the hook, and which sensor."""
        return self.hook.name, self.cell

    @property
    def is_factor(self) -> bool:
        """Whether the plant takes the exponential of the function as a factor."""
        return self.hook.fold is Fold.FACTORS


def place(
    place_id: str,
    stage: Stage,
    hook: Hook,
    what: str,
    argument: Argument,
    unit: str,
    largest: float,
    *,
    at: Function | str,
    shape: Shape = Shape.ANY,
    depends_on_time: bool = False,
    **more: Any,
) -> Place:
    """A place, whose equation and parameters follow from its shape; `more` as in `Place`."""
    f = f'f({argument.symbol})'
    enters = f'exp({f})' if hook.fold is Fold.FACTORS else f
    kind = '' if shape is Shape.ANY else f', {shape}'
    return Place(
        place_id,
        stage,
        order=0,
        physics=f'{what}, a function of {argument.words}.',
        equation=f'{enters}{kind}, {argument.symbol} = {argument.words}',
        source=SOURCE,
        parameters=_parameters(argument, unit, largest),
        traits=Traits(depends_on_time=depends_on_time),
        hook=hook,
        argument=argument,
        at=at,
        unit=unit,
        largest=largest,
        shape=shape,
        **more,
    )


def _parameters(argument: Argument, unit: str, largest: float) -> tuple[Parameter, ...]:
    def value(name: str) -> Parameter:
        return Parameter(name, unit, -largest, largest, 0.0, off=0.0)

    ends = [(name, getattr(argument, name)) for name in ('low', 'high')]
    lag = (Parameter('lag_s', 's', *LAGS_S, typical=1.0),) if argument.lags else ()
    return (
        *(Parameter(name, argument.unit, -1e9, 1e9, end) for name, end in ends),
        *(value(f'value_{i}') for i in range(NODES)),
        *lag,
    )


TIME = Argument('t', 'time since the start', 's', 0.0, 60.0)
SPEED = Argument('v', 'sliding speed, never negative', 'm/s', 0.0, 0.02)
DISTANCE = Argument('d', 'distance slid so far', 'm', 0.0, 0.5, kept_up=True)
TENSION = Argument('T', 'mean tension', 'N', 0.0, 30.0)
BOTH_TENSIONS = Argument('T', 'mean tension of both wires', 'N', 0.0, 30.0, kept_up=True)
DIFFERENCE = Argument('D', "difference of the wires' mean tensions", 'N', -30.0, 30.0, kept_up=True)
ANGLE = Argument('q', "the joint's angle", 'rad', -2.0, 2.0)
OTHER_ANGLE = Argument('q_other', "the other joint's angle", 'rad', -2.0, 2.0)
ANGULAR_SPEED = Argument('w', "the joint's angular speed", 'rad/s', -10.0, 10.0)
SHAFT = Argument('m', "the shaft's angle", 'rad', -2.0, 2.0)
SHAFT_SPEED = Argument('w', "the shaft's speed", 'rad/s', -10.0, 10.0)
COMMANDED = Argument('u', 'the command', 'rad', -2.0, 2.0)
SERVO = Argument('e', "the servo's error", 'rad', -0.5, 0.5)
WOUND = Argument('s', 'what the pulley has wound up', 'm', -0.005, 0.005)
LAGGED_TENSION = Argument(
    'F', 'the tension above that at rest, lagging', 'N', -15.0, 15.0, lags=True
)
LAGGED_SLIDING = Argument('y', 'the sliding speed, lagging', 'm/s', 0.0, 0.02, lags=True)
RELAXING = Argument('z', "the joint's angle less itself lagging", 'rad', -1.0, 1.0, lags=True)
READING = Argument('T', 'the tension at the motor', 'N', 0.0, 30.0)
NEIGHBOUR = Argument('T', 'the tension of the other wire at the motor', 'N', 0.0, 30.0)
CYCLE = Argument('t', 'time since the start, one cycle of it', 's', 0.0, 4.0)
CYCLE_OF_SHAFT = Argument('m', "the shaft's angle, one cycle of it", 'rad', 0.0, math.pi / 6.0)


def _actuator() -> None:
    of = Stage.ACTUATOR
    place(
        'command_of_command', of, COMMAND, 'What is added to the command at the servo',
        COMMANDED, 'rad', 3.0, at='command', shape=Shape.ODD,
    )  # fmt: skip
    place(
        'servo_error_of_error', of, SERVO_ERROR, "What is added to the servo's error",
        SERVO, 'rad', 0.5, at='error', shape=Shape.ODD,
    )  # fmt: skip
    what = "What is added to the pulley's angle behind the shaft"
    place(
        'pulley_of_shaft', of, PULLEY_ANGLE, what,
        SHAFT, 'rad', 0.5, at='shaft', from_zero=True,
    )  # fmt: skip
    place(
        'pulley_periodic', of, PULLEY_ANGLE, what,
        CYCLE_OF_SHAFT, 'rad', 0.5, at='shaft', shape=Shape.PERIODIC,
        from_zero=True,
    )  # fmt: skip
    place(
        'pulley_of_tension', of, PULLEY_ANGLE, what,
        DIFFERENCE, 'rad', 0.5, at=tension_difference, from_zero=True,
    )  # fmt: skip
    place(
        'effort_of_speed', of, EFFORT, "What is added to the motor's torque as the servo reads it",
        SHAFT_SPEED, 'N m', 1.0, at='speed', shape=Shape.ODD,
    )  # fmt: skip


def _transmission() -> None:
    of = Stage.TRANSMISSION
    what = 'Factor on the capstan exponent'
    place('exponent_of_speed', of, EXPONENT, what, SPEED, '-', 3.0, at='speed')
    place('exponent_of_time', of, EXPONENT, what, TIME, '-', 3.0, at='time', depends_on_time=True)
    place('exponent_of_angle', of, EXPONENT, what, ANGLE, '-', 3.0, at=own_angle)
    place('exponent_of_other_angle', of, EXPONENT, what, OTHER_ANGLE, '-', 3.0, at=other_angle)
    place('exponent_of_tension', of, EXPONENT, what, BOTH_TENSIONS, '-', 3.0, at=both_tensions)
    place(
        'exponent_of_lagging_speed', of, EXPONENT, what,
        LAGGED_SLIDING, '-', 3.0, at=lagged_speed,
    )  # fmt: skip
    place(
        'exponent_of_distance', of, EXPONENT, what,
        DISTANCE, '-', 3.0, at=path, depends_on_time=True,
    )  # fmt: skip
    place(
        'film_drag_of_speed', of, FILM_DRAG, 'Drag of the whole sheath on a wire by its speed',
        SPEED, 'N s/m', 5000.0, at='speed', never_negative=True,
    )  # fmt: skip
    what = "Factor on each wire's stiffness"
    place('stiffness_of_tension', of, STIFFNESS, what, TENSION, '-', 2.0, at='tension')
    place(
        'stiffness_of_time', of, STIFFNESS, what, TIME, '-', 2.0, at=now,
        depends_on_time=True,
    )  # fmt: skip
    what = "What is added to both wires' lengths"
    place('length_of_time', of, LENGTH, what, TIME, 'm', 0.02, at='time', depends_on_time=True)
    place('length_of_angle', of, LENGTH, what, ANGLE, 'm', 0.02, at=own_angle, from_zero=True)
    place(
        'length_of_lagging_tension', of, LENGTH, "What is added to each wire's length",
        LAGGED_TENSION, 'm', 0.02, at=lagged_tension,
        from_zero=True,
    )  # fmt: skip
    place(
        'length_difference_of_time', of, LENGTH,
        "What is added to the positive wire's length and taken from the negative one's",
        TIME, 'm', 0.02, at='time', sign=opposite, depends_on_time=True,
    )  # fmt: skip
    place(
        'travel_of_travel', of, TRAVEL_OF, 'What the pulley winds up more of both wires',
        WOUND, 'm', 0.005, at='travel', shape=Shape.EVEN,
    )  # fmt: skip


def _joint() -> None:
    of = Stage.JOINT
    what = (
        'What is added to the displacement of the positive wire at the joint, the negative one '
        'opposite'
    )
    place('end_way_of_angle', of, END_LENGTH, what, ANGLE, 'm', 0.005, at=own_angle, from_zero=True)
    place(
        'end_way_of_other_angle', of, END_LENGTH, what,
        OTHER_ANGLE, 'm', 0.005, at='other', from_zero=True,
    )  # fmt: skip
    what = 'Moment on the joint'
    place('load_of_angle', of, LOAD, what, ANGLE, 'N m', 0.1, at='angle', by_step=unit_slope)
    for name, shape in (('load_of_speed', Shape.ODD), ('load_of_speed_size', Shape.EVEN)):
        place(
            name, of, LOAD, what, ANGULAR_SPEED, 'N m', 0.1,
            at=angular_speed, by_step=per_tick, shape=shape,
        )  # fmt: skip
    place('load_of_time', of, LOAD, what, TIME, 'N m', 0.1, at='time', depends_on_time=True)
    place(
        'load_periodic', of, LOAD, what, CYCLE, 'N m', 0.1,
        at='time', shape=Shape.PERIODIC, depends_on_time=True,
    )  # fmt: skip
    place(
        'load_of_relaxing_angle', of, LOAD, what, RELAXING, 'N m', 0.1,
        at=angle_less_lagged, by_step=unit_slope, shape=Shape.ODD,
    )  # fmt: skip
    place('load_of_other_angle', of, LOAD, what, OTHER_ANGLE, 'N m', 0.1, at='other')
    what = "Factor on the joint's friction"
    place('joint_friction_of_angle', of, JOINT_FRICTION_FACTOR, what, ANGLE, '-', 3.0, at=own_angle)
    place(
        'joint_friction_of_time', of, JOINT_FRICTION_FACTOR, what, TIME, '-', 3.0, at=now,
        depends_on_time=True,
    )  # fmt: skip


def _sensing() -> None:
    of = Stage.SENSING
    what = "What is added to the tracker's angle"
    place('tracker_of_angle', of, TRACKER, what, ANGLE, 'rad', 1.0, at='angle')
    place('tracker_of_other_angle', of, TRACKER, what, OTHER_ANGLE, 'rad', 1.0, at=other_angle)
    place('tracker_of_time', of, TRACKER, what, TIME, 'rad', 1.0, at='time', depends_on_time=True)
    for cell, name in enumerate(('pos', 'neg')):
        what = f'What is added to the reading of the load cell of wire {name}'
        cells = f'load_cell_{name}'
        place(
            f'{cells}_of_tension', of, LOAD_CELL, what, READING, 'N', 50.0, at='reading', cell=cell
        )
        place(
            f'{cells}_of_other_wire', of, LOAD_CELL, what, NEIGHBOUR, 'N', 50.0,
            at='neighbour', cell=cell,
        )  # fmt: skip
        place(
            f'{cells}_of_time', of, LOAD_CELL, what, TIME, 'N', 50.0, at='time', cell=cell,
            depends_on_time=True,
        )  # fmt: skip


for _define in (_actuator, _transmission, _joint, _sensing):
    _define()

FUNCTIONS: dict[str, Place] = in_order_of_chain(Place)
"""All places by their ids, in the order of the chain."""


def describe_place(place_id: str) -> Place:
    """The place of that id; an InputError names the nearest."""
    if place_id not in FUNCTIONS:
        raise InputError(f'unknown place {place_id}: {nearest(place_id, FUNCTIONS)}')
    return FUNCTIONS[place_id]
