"""The moment that acts on a bending joint from outside, by inverting the joint's plant.

The plant is driven by the measured motor, and an unknown moment is sought under which its joint
follows the measured angle: a disturbance observer (Chen et al., IEEE Trans. Ind. Electron. 63(2),
2016) of a plant with memory, so that friction of sheaths, section and joint is that of the path
that was gone. The angle is known to a few tenths of a degree, in which friction may build up or
not: what is consistent with it is a set of moments, from the one that would have the joint at the
lower end of the angle's bounds to the one that would have it at the upper end.

The path within those bounds is not known either, and friction remembers it. Two are followed. One
keeps to the angle, with a play of its bounds, so that noise is not taken for reversals: right where
something stops the joint, but short of every turning point in free motion. The other keeps to the
plant as long as the bounds allow: right in free motion, but too far where something stops the
joint. The moment is within the sets of both together.
"""

from enum import Enum, auto
from typing import NamedTuple

import numpy as np

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.physics import layout
from endoscope_core.physics.effects.external_load import EFFECT as LOAD
from endoscope_core.physics.effects.tracker_delay import EFFECT as TRACKER_DELAY
from endoscope_core.physics.kernel import advance_tick, read_sensors
from endoscope_core.physics.layout import IN_MOTOR, OUT_BENDING
from endoscope_core.physics.packing import rest_state

TICK_S = 5e-3
BLOCK_TICKS = 5
LARGEST_MOMENT = 0.1
"""N m: forty times what the wires of the nominal rig can exert on the joint."""
# A hundredth of the bounds of an angle in rad, and N m.
_ANGLE_PRECISION, _MOMENT_PRECISION = 3e-5, 1e-6
_FIRST_STEP, _GROWTH, _TRIES = 5e-5, 2.5, 60
_MOMENT = LOAD.first_parameter
_KEPT = 0.9
"""Share of the moment that is kept in a block which none at all would explain as well."""
_RETENSIONED = 0.02
"""Share of the difference between measured and predicted tension that a block corrects: a wire that
was tightened is followed within seconds. A wire that has just turned answers with up to 32 times
what slides as a whole, so that more than a thirtieth could overshoot."""


@compiled
def _bent(
    begin: Array,
    x: Array,
    history: Array,
    sheath: Array,
    p: Array,
    on: Flags,
    inputs: Array,
    shaft: Array,
    before: float,
    moment: float,
    out: Array,
) -> float:
    """Angle in rad after a block from the state `begin`, in which the moment goes from `before`.

    Both are in N m; fills `x` and `out`.
    """
    for k in range(x.shape[0]):
        x[k] = begin[k]
    ticks = shaft.shape[0]
    for k in range(ticks):
        inputs[IN_MOTOR] = shaft[k]
        # Evenly: all at once it would turn the joint back before the motor takes it along, and
        # friction would remember.
        p[_MOMENT] = before + (moment - before) * (k + 1) / ticks
        advance_tick(x, history, sheath, p, on, inputs, TICK_S)
    read_sensors(x, history, sheath, p, on, TICK_S, out)
    return out[OUT_BENDING]


@compiled
def _moment_for(
    angle: float,
    before: float,
    first: float,
    begin: Array,
    x: Array,
    history: Array,
    sheath: Array,
    p: Array,
    on: Flags,
    inputs: Array,
    shaft: Array,
    out: Array,
    stiffness: Array,
) -> float:
    """Moment in N m that bends the joint to `angle` rad in a block, sought from `first`.

    `stiffness` (1,) in N m/rad is about that of the joint, and is found anew.
    """
    joint = (x, history, sheath, p, on, inputs, shaft, before)
    q = _bent(begin, *joint, first, out)
    low, high, q_low, q_high = first, first, q, q
    # What was found for another angle of the block, or the one before, is mostly right again.
    step = min(max(_FIRST_STEP, stiffness[0] * abs(angle - q)), LARGEST_MOMENT)
    while q_high < angle - _ANGLE_PRECISION and high < LARGEST_MOMENT:
        low, q_low = high, q_high
        high += step
        step *= _GROWTH
        q_high = _bent(begin, *joint, high, out)
    while q_low > angle + _ANGLE_PRECISION and low > -LARGEST_MOMENT:
        high, q_high = low, q_low
        low -= step
        step *= _GROWTH
        q_low = _bent(begin, *joint, low, out)
    if q_high > q_low:
        stiffness[0] = (high - low) / (q_high - q_low)
    if q_high < angle + _ANGLE_PRECISION:
        return high
    if q_low > angle - _ANGLE_PRECISION:
        return low
    # The angle rises with the moment: regula falsi as of Illinois (Dowell, Jarratt, BIT 11, 1971).
    moment, side = first, 0
    under, over = q_low - angle, q_high - angle
    for _ in range(_TRIES):
        if high - low < _MOMENT_PRECISION:
            break
        moment = (low * over - high * under) / (over - under)
        off = _bent(begin, *joint, moment, out) - angle
        if abs(off) < _ANGLE_PRECISION:
            break
        if off < 0.0:
            low, under = moment, off
            over *= 0.5 if side < 0 else 1.0
            side = -1
        else:
            high, over = moment, off
            under *= 0.5 if side > 0 else 1.0
            side = 1
    return moment


class MomentSet(NamedTuple):
    """Moments from outside that are consistent with a block, N m, positive for a growing angle."""

    low: float
    likely: float
    high: float


class Block(NamedTuple):
    """What was measured of a joint in a block."""

    shaft: Array  # (BLOCK_TICKS,), rad, at the ends of the ticks
    # rad, at the end of the block, and the half-width of its bounds
    angle: float
    half_width: float
    other: float  # the other joint's angle, rad
    tension: Array  # (2,), N, of both wires at the end of the block; NaN where it is not measured


class Path(Enum):
    """What the joint keeps to within the bounds of its angle."""

    ANGLE = auto()
    PLANT = auto()


class ExternalMoment:
    """Observer of one joint, from rest at a shaft angle.

    Parameters
    ----------
    parameters, on : array
        Packed parameters and flags of the joint, which are copied.
    shaft : float
        Angle of the motor's shaft in rad.
    """

    def __init__(self, parameters: Array, on: Flags, shaft: float) -> None:
        self._angle_led, self._plant_led = (_Follower(parameters, on, shaft, p) for p in Path)

    def follow(self, block: Block) -> MomentSet:
        """Moments under which the joint follows a block."""
        by_angle, by_plant = self._angle_led.follow(block), self._plant_led.follow(block)
        free = by_plant.low <= 0.0 <= by_plant.high
        likely = by_plant.likely if free else self._angle_led.moment_for(block.angle, block)
        self._angle_led.go_on(block)
        self._plant_led.go_on(block)
        return MomentSet(min(by_angle.low, by_plant.low), likely, max(by_angle.high, by_plant.high))


class _Follower:
    """A copy of the joint's plant that goes one path within the bounds of the angle."""

    def __init__(self, parameters: Array, on: Flags, shaft: float, path: Path) -> None:
        p, flags = parameters[None].copy(), on[None].copy()
        # Samples come with the time at which the tip was there.
        flags[0, TRACKER_DELAY.flag] = False
        flags[0, LOAD.flag] = True
        p[0, LOAD.places] = [parameter.typical for parameter in LOAD.parameters]
        p[0, _MOMENT : _MOMENT + 2] = 0.0  # the moment, and the time of its onset
        x, history, sheath = rest_state(p, flags, TICK_S, np.array([shaft]))
        self._x, self._begin = x[0], x[0].copy()
        self._inputs, self._out = np.zeros(layout.INPUTS), np.empty(layout.OUTPUTS)
        self._rest = (history[0], sheath[0], p[0], flags[0], self._inputs)
        self._stiffness, self._of_joint = p[0, layout.WIRE_STIFFNESS], np.zeros(1)
        self._path, self._angle = path, float(x[0, layout.TIP])
        self._moment = self._next = 0.0

    def follow(self, block: Block) -> MomentSet:
        """Moments under which this copy follows a block, and the one under which it will go on."""
        self._begin[:] = self._x
        self._inputs[layout.IN_OTHER_JOINT] = block.other
        lowest, highest = block.angle - block.half_width, block.angle + block.half_width
        low = self.moment_for(lowest, block, self._moment)
        high = self.moment_for(highest, block, max(low, self._moment))
        if self._path is Path.PLANT:
            wanted = self._moment * (_KEPT if low <= 0.0 <= high else 1.0)
            self._next = min(max(wanted, low), high)
        elif self._angle <= lowest or self._angle >= highest:
            self._next = low if self._angle <= lowest else high
            self._angle = lowest if self._angle <= lowest else highest
        else:
            share = (self._angle - lowest) / (highest - lowest)
            self._next = self.moment_for(self._angle, block, low + share * (high - low))
        return MomentSet(low, self._next, high)

    def go_on(self, block: Block) -> None:
        """Go through the block that was followed."""
        joint = (self._begin, self._x, *self._rest, block.shaft)
        _bent(*joint, self._moment, self._next, self._out)
        self._moment = self._next
        wires = self._out[[layout.OUT_TENSION_A, layout.OUT_TENSION_B]]
        more = _RETENSIONED * np.nan_to_num(block.tension - wires)
        self._x[layout.TRAVEL : layout.TRAVEL + 2] -= more / self._stiffness

    def moment_for(self, angle: float, block: Block, first: float | None = None) -> float:
        """The moment in N m that bends the joint to an angle in rad in a block."""
        joint = (self._begin, self._x, *self._rest, block.shaft, self._out, self._of_joint)
        near = self._next if first is None else first
        return _moment_for(angle, self._moment, near, *joint)
