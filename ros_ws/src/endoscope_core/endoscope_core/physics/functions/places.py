"""The table of places at which a smooth function of one state can be added.

What the wires' tension, the distance slid and the joint's own angle do to a wire acts a tick late:
nothing that they change is then part of the tick's own balance.
"""

import math

from endoscope_core.physics.effect import Stage
from endoscope_core.physics.functions.place import Argument, Shape, place
from endoscope_core.physics.hooks import (
    COMMAND,
    EFFORT,
    END_LENGTH,
    EXPONENT,
    FILM_DRAG,
    JOINT_FRICTION,
    LENGTH,
    LOAD,
    LOAD_CELL,
    PULLEY_ANGLE,
    SERVO_ERROR,
    STIFFNESS,
    TRACKER,
    TRAVEL_OF,
)
from endoscope_core.physics.layout import (
    JOINT,
    LAGGED_ANGLE,
    LAGGED_LOAD,
    LAGGED_SPEED,
    MEAN_TENSION,
    NOW,
    OTHER,
    PATH,
    REST_TENSION,
    TENSION_DIFFERENCE,
)

TIME = Argument('t', 'time since the start', 's', 0.0, 60.0)
SPEED = Argument('v', 'sliding speed, never negative', 'm/s', 0.0, 0.02)
DISTANCE = Argument('d', 'distance slid so far', 'm', 0.0, 0.5)
TENSION = Argument('T', 'mean tension', 'N', 0.0, 30.0)
BOTH_TENSIONS = Argument('T', 'mean tension of both wires', 'N', 0.0, 30.0)
DIFFERENCE = Argument('D', "difference of the wires' mean tensions", 'N', -30.0, 30.0)
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

_OWN_ANGLE, _OTHER = f'x[{JOINT}]', f'x[{OTHER}]'
_BOTH, _DIFFERENCE, _PATH = f'x[{MEAN_TENSION}]', f'x[{TENSION_DIFFERENCE}]', f'x[{PATH}]'
KEPT_UP = (_BOTH, _DIFFERENCE, _PATH)
"""Arguments that nothing but functions depends on."""


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
        DIFFERENCE, 'rad', 0.5, at=_DIFFERENCE, from_zero=True,
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
    place('exponent_of_angle', of, EXPONENT, what, ANGLE, '-', 3.0, at=_OWN_ANGLE)
    place('exponent_of_other_angle', of, EXPONENT, what, OTHER_ANGLE, '-', 3.0, at=_OTHER)
    place('exponent_of_tension', of, EXPONENT, what, BOTH_TENSIONS, '-', 3.0, at=_BOTH)
    place(
        'exponent_of_lagging_speed', of, EXPONENT, what,
        LAGGED_SLIDING, '-', 3.0, at=f'x[{LAGGED_SPEED}]',
    )  # fmt: skip
    place(
        'exponent_of_distance', of, EXPONENT, what,
        DISTANCE, '-', 3.0, at=_PATH, depends_on_time=True,
    )  # fmt: skip
    place(
        'film_drag_of_speed', of, FILM_DRAG, 'Drag of the whole sheath on a wire by its speed',
        SPEED, 'N s/m', 5000.0, at='speed', never_negative=True,
    )  # fmt: skip
    what = "Factor on each wire's stiffness"
    place('stiffness_of_tension', of, STIFFNESS, what, TENSION, '-', 2.0, at='tension')
    place(
        'stiffness_of_time', of, STIFFNESS, what, TIME, '-', 2.0, at=f'x[{NOW}]',
        depends_on_time=True,
    )  # fmt: skip
    what = "What is added to both wires' lengths"
    place('length_of_time', of, LENGTH, what, TIME, 'm', 0.02, at='time', depends_on_time=True)
    place('length_of_angle', of, LENGTH, what, ANGLE, 'm', 0.02, at=_OWN_ANGLE, from_zero=True)
    place(
        'length_of_lagging_tension', of, LENGTH, "What is added to each wire's length",
        LAGGED_TENSION, 'm', 0.02, at=f'x[{LAGGED_LOAD} + wire] - x[{REST_TENSION}]',
        from_zero=True,
    )  # fmt: skip
    place(
        'length_difference_of_time', of, LENGTH,
        "What is added to the positive wire's length and taken from the negative one's",
        TIME, 'm', 0.02, at='time', sign='(1.0 - 2.0 * wire)', depends_on_time=True,
    )  # fmt: skip
    place(
        'travel_of_travel', of, TRAVEL_OF, 'What the pulley winds up more of both wires',
        WOUND, 'm', 0.005, at='travel', shape=Shape.EVEN,
    )  # fmt: skip


def _joint() -> None:
    of = Stage.JOINT
    what = 'What is added to the way of the positive wire at the joint, the negative one opposite'
    place(
        'end_way_of_angle', of, END_LENGTH, what, ANGLE, 'm', 0.005, at=_OWN_ANGLE, from_zero=True
    )
    place(
        'end_way_of_other_angle', of, END_LENGTH, what,
        OTHER_ANGLE, 'm', 0.005, at='other', from_zero=True,
    )  # fmt: skip
    what = 'Moment on the joint'
    place('load_of_angle', of, LOAD, what, ANGLE, 'N m', 0.1, at='angle', by_step='1.0')
    for name, shape in (('load_of_speed', Shape.ODD), ('load_of_speed_size', Shape.EVEN)):
        place(
            name, of, LOAD, what, ANGULAR_SPEED, 'N m', 0.1,
            at='step / tick', by_step='(1.0 / tick)', shape=shape,
        )  # fmt: skip
    place('load_of_time', of, LOAD, what, TIME, 'N m', 0.1, at='time', depends_on_time=True)
    place(
        'load_periodic', of, LOAD, what, CYCLE, 'N m', 0.1,
        at='time', shape=Shape.PERIODIC, depends_on_time=True,
    )  # fmt: skip
    place(
        'load_of_relaxing_angle', of, LOAD, what, RELAXING, 'N m', 0.1,
        at=f'angle - x[{LAGGED_ANGLE}]', by_step='1.0', shape=Shape.ODD,
    )  # fmt: skip
    place('load_of_other_angle', of, LOAD, what, OTHER_ANGLE, 'N m', 0.1, at='other')
    what = "Factor on the joint's friction"
    place('joint_friction_of_angle', of, JOINT_FRICTION, what, ANGLE, '-', 3.0, at=_OWN_ANGLE)
    place(
        'joint_friction_of_time', of, JOINT_FRICTION, what, TIME, '-', 3.0, at=f'x[{NOW}]',
        depends_on_time=True,
    )  # fmt: skip


def _sensing() -> None:
    of = Stage.SENSING
    what = "What is added to the tracker's angle"
    place('tracker_of_angle', of, TRACKER, what, ANGLE, 'rad', 1.0, at='angle')
    place('tracker_of_other_angle', of, TRACKER, what, OTHER_ANGLE, 'rad', 1.0, at=_OTHER)
    place('tracker_of_time', of, TRACKER, what, TIME, 'rad', 1.0, at='time', depends_on_time=True)
    for cell, name in enumerate(('pos', 'neg')):
        what = f'What is added to the reading of the load cell of wire {name}'
        only = f'cell == {cell}'
        cells = f'load_cell_{name}'
        place(
            f'{cells}_of_tension', of, LOAD_CELL, what, READING, 'N', 50.0, at='reading', only=only
        )
        place(
            f'{cells}_of_other_wire', of, LOAD_CELL, what, NEIGHBOUR, 'N', 50.0,
            at='neighbour', only=only,
        )  # fmt: skip
        place(
            f'{cells}_of_time', of, LOAD_CELL, what, TIME, 'N', 50.0, at='time', only=only,
            depends_on_time=True,
        )  # fmt: skip


for _define in (_actuator, _transmission, _joint, _sensing):
    _define()
