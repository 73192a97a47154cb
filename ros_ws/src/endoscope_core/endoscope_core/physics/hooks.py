"""The places in the chain at which effects act.

An effect's compiled function is linked to a hook by `hook`; the kernel calls the hook. Links of a
hook run in the order of the chain, and only those whose effect is on. How they add up is the hook's
fold: the value goes *through* all of them; their results are *factors*, or *terms* of a sum; the
*least* counts; or all are *called* for what they do to the states.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from endoscope_core.physics.effect import Effect
from endoscope_core.physics.sensing import RecordingFaults


class Fold(StrEnum):
    """How the links of a hook add up."""

    THROUGH = 'through'
    FACTORS = 'factors'
    TERMS = 'terms'
    LEAST = 'least'
    CALLS = 'calls'


@dataclass(frozen=True)
class Hook:
    """A place in the chain."""

    name: str
    fold: Fold
    # Of the hook and of every link, separated by commas. `p`, `x`: arrays of parameters and states.
    # Of a value that goes through, the first argument after them is the value.
    arguments: str
    results: int = 1  # how many numbers a link gives

    @property
    def value(self) -> str:
        """Name of the value that goes through."""
        return next(a for a in self.arguments.split(', ') if a not in ('p', 'x'))


COMMAND = Hook('command', Fold.THROUGH, 'p, x, command, history, tick')
"""Command that reaches the servo, mean over the tick, rad of the shaft."""
SERVO_ERROR = Hook('servo_error', Fold.THROUGH, 'p, x, error, from_error, kept')
"""Servo's error, rad; its speed becomes ``from_error * error + kept * speed``."""
TORQUE = Hook('torque', Fold.LEAST, 'p, x, speed')
"""Largest torque in N m of the motor at a speed of the shaft in rad/s, negative where its load
drives it; infinite without a link."""
PULLEY_ANGLE = Hook('pulley_angle', Fold.THROUGH, 'p, x, shaft')
"""Pulley's angle behind the shaft, rad."""
TRAVEL_OF = Hook('travel_of', Fold.THROUGH, 'p, x, travel, wire')
"""By how much the pulley winds up wire 0 or 1, m; without a link radius times angle."""
EXPONENT = Hook('exponent', Fold.FACTORS, 'p, x, speed, time, tick')
"""Factor on the capstan exponent, mean over the tick; `speed` of sliding in m/s, not negative: that
at the motor, as the joint's answers at once to a friction that would answer to it."""
DIRECTION = Hook('direction', Fold.FACTORS, 'p, x', results=2)
"""Factors on the exponent where a wire slides towards the motor, and towards the joint."""
FRICTION_FLOOR = Hook('friction_floor', Fold.TERMS, 'p, x')
"""Friction that does not grow with the tension, as the tension that would cause it, N."""
FILM_DRAG = Hook('film_drag', Fold.TERMS, 'p, x, speed')
"""Drag of the whole sheath on a wire by sliding speed, N s/m, at a speed in m/s, not negative."""
STIFFNESS = Hook('stiffness', Fold.FACTORS, 'p, x, tension')
"""Factor on a wire's tangent stiffness at a mean tension in N."""
LENGTH = Hook('length', Fold.TERMS, 'p, x, wire, time')
"""What has been added to the length of wire 0 or 1 along the sheath, m."""
JOINT_FRICTION_FACTOR = Hook('joint_friction_factor', Fold.FACTORS, 'p, x')
"""Factor on the joint's friction in the tick that begins."""
END_LENGTH = Hook('end_length', Fold.TERMS, 'p, x, other')
"""What the other joint's angle in rad adds to the displacement of the positive wire at the joint in
m, and takes from that of the negative one."""
LOAD = Hook('load', Fold.TERMS, 'p, x, angle, step, other, time, tick', results=2)
"""Moment on the joint in N m, bent by `step` to `angle`, and minus its slope by `step`."""
TIP_ANGLE = Hook('tip_angle', Fold.THROUGH, 'p, x, joint')
"""Tip's angle behind the joint's, rad."""
EFFORT = Hook('effort', Fold.THROUGH, 'p, x, effort, speed')
"""Motor's torque as the servo reads it, N m."""
TRACKER = Hook('tracker', Fold.THROUGH, 'p, x, angle, history, time, tick')
"""Bending angle as the tracker reads it, rad."""
CELL_INPUT = Hook('cell_input', Fold.THROUGH, 'p, x, tension, cell, history, tick')
"""Tension that load cell 0 or 1 converts, N."""
LOAD_CELL = Hook('load_cell', Fold.THROUGH, 'p, x, reading, cell, neighbour, time')
"""Tension as load cell 0 or 1 reads it; `neighbour` is the true tension of the other wire, N."""
ADVANCE = Hook('advance', Fold.CALLS, 'p, x, load_a, load_b, time, tick')
"""End of a tick: lets states follow; `load_a`, `load_b` are the wires' mean tensions in N."""

HOOKS = tuple(each for each in vars().values() if isinstance(each, Hook))

Function = Callable[..., Any]
LINKS: dict[str, list[tuple[Effect, Function]]] = {each.name: [] for each in HOOKS}
"""Effects and their functions by the hook's name, in no order."""


ON_SAMPLES: dict[str, Callable[[Mapping[str, float], int], RecordingFaults]] = {}
"""What effects do to samples and not to the rig: from the values of the parameters by their names
and the joint's column to faults, by the effect's id."""


def on_samples(
    effect: Effect,
) -> Callable[[Callable[[Mapping[str, float], int], RecordingFaults]], Function]:
    """Link what an effect does to samples; a decorator that gives the function back."""

    def link(function: Callable[[Mapping[str, float], int], RecordingFaults]) -> Function:
        ON_SAMPLES[effect.id] = function
        return function

    return link


def hook(effect: Effect, at: Hook) -> Callable[[Function], Function]:
    """Link the decorated compiled function of an effect to a hook, whose arguments it has."""

    def link(function: Function) -> Function:
        LINKS[at.name].append((effect, function))
        return function

    return link
