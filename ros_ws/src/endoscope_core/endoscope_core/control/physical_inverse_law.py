"""Compiled law that inverts the tendon-sheath joint: which motor angle bends the tip as desired.

Notation of the nominal plant (Kaneko et al. 1991; Dahl 1968): angles in rad, joint-equivalent; `m`
motor, `q` tip, `z` the sliding state of the positive wire (the negative one's is ``-z``), `zj` the
state of the joint's friction, ``h = phi z / 2``. Where wires and joint are in balance,

    r (Ta exp(-h) - Tb exp(h)) = K q + tau_f zj + c q'   =:  r P
    m - q = (P + 2 T0 sinh h) / (2 k r cosh h)           =:  X(z, q, zj)

Where a share `e` of the friction is spread over eight nodes along the sheath, ``exp(h)`` becomes
``S(z) = sum_i L_i exp(phi z ((1 - e) / 2 + e n_i / 8))`` over the springs of relative lengths `L_i`
with `n_i` nodes between them and the tip, ``exp(-h)`` becomes ``S(-z)``, and ``X = (P - T0 (1/S(z)
- 1/S(-z))) / (k r (1/S(z) + 1/S(-z)))``.

While it slides one way, ``z = s`` (the direction), and ``m = q_d + X(s, q_d, zj_d)`` is the
inverse.

At a reversal `z` changes sign within a few pre-sliding distances of ``(m + q) / 2``, long before
`m` has crossed the dead zone ``X(s) - X(-s)``. Friction that held tension back lets go, and the tip
is driven further the old way, by up to half the dead zone: the kick. No motor motion can avoid it
once the tip is at its turning point. Before it, the kick can be used: while `z` changes, sliding
stalls, ``dz = (1 + s z) r / (2 xs) d(m + q)``, and with ``G = X'(z) (1 + s z) r / (2 xs)``

    dm = -(G + 1) / (G - 1) dq            for G > 1:

the tip goes on the old way because the motor comes back. The law therefore predicts the turning
point from the desired motion (`distance_to_reversal`), and as soon as what is left to go is no more
than what the release of the friction can carry (`reserve`), it lets the release do it. At the
turning point `z` has all but changed sign, the dead zone is nearly crossed, and little is left to
kick with. If the desired motion does not turn after all, the law goes back to pushing.

A turning point is believed in once the speed has fallen by more than noise of one count can make it
fall, or the angle in which it shows has come back by two counts.
"""

from __future__ import annotations

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.control.desired_motion import BANDWIDTH
from endoscope_core.control.smoothing import COUNT
from endoscope_core.effects import distributed_friction
from endoscope_core.effects.distributed_friction import NODES
from endoscope_core.effects.slots import (
    CAPSTAN_EXPONENT,
    JOINT_DAMPING,
    JOINT_FRICTION,
    JOINT_PRESLIDING,
    JOINT_RADIUS,
    JOINT_STIFFNESS,
    PRESLIDING_DISTANCE,
    PRETENSION,
    WIRE_STIFFNESS,
)

(
    SENSE,
    RELEASING,
    TARGET,
    ACCELERATION,
    JERK,
    SPEED_BEFORE,
    FORESEEN,
    JOINT_MEMORY,
    REFRAIN,
    TURN,
    FASTEST,
) = range(11)
MEMORY = 11
"""Places in the law's memory: direction, whether it releases, motor angle aimed at (rad), estimates
of the desired acceleration and jerk, desired speed before, desired angle foreseen, joint friction
state along the desired motion, s until the next release may begin, play of the angle in which a
turning point shows, greatest desired speed in this direction."""

_ACCELERATION_TIME = 0.03
_JERK_TIME = 0.05
_SLOWEST, _FASTEST = 0.04, 9.0
_RELEASED = 1.05
_STEEPEST_RELEASE = 4.0
_RELEASE_GAIN = 5.0
_GIVE_UP = 0.06
_REFRAIN = 0.15
_PUSH_THROUGH = 0.08
_STILL = 1.0e-3
_SPEED_NOISE = 4.0 / math.e * BANDWIDTH * COUNT
"""By how much, in rad/s, the speed may fall although the motion does not slow down.

An angle that is right to one count either way leaves in a velocity that `SmoothFollower` takes from
it at most one count times the integral of ``|w**2 (1 - w t) exp(-w t)|``, ``2 w / e``, either way.
"""


@compiled
def equilibrium_stretch(p: Array, q: float, speed: float, z: float, zj: float) -> float:
    """``X``: motor less tip angle in rad at which the joint is in balance.

    `p` holds 0 as the share of spread friction where there is none.
    """
    load = p[JOINT_STIFFNESS] * q + p[JOINT_FRICTION] * zj + p[JOINT_DAMPING] * speed
    r = p[JOINT_RADIUS]
    along = p[CAPSTAN_EXPONENT] * z
    spread = p[distributed_friction.SHARE]
    loose = tight = math.exp(0.5 * (1.0 - spread) * along)
    loose = 1.0 / loose
    if spread > 0.0:
        more = less = 0.0
        for spring in range(NODES + 1):
            length = distributed_friction.length(p, spring)
            exponent = spread * along * (NODES - spring) / NODES
            more += length * math.exp(exponent)
            less += length * math.exp(-exponent)
        tight *= more
        loose *= less
    return (load / r - p[PRETENSION] * (1.0 / tight - 1.0 / loose)) / (
        p[WIRE_STIFFNESS] * r * (1.0 / tight + 1.0 / loose)
    )


@compiled
def release_gain(p: Array, q: float, z: float, sense: float) -> float:
    """``G``: how much faster the stretch in balance falls than it is taken away."""
    slope = equilibrium_stretch(p, q, 0.0, (z + 1e-3) * sense, sense)
    slope -= equilibrium_stretch(p, q, 0.0, (z - 1e-3) * sense, sense)
    slope *= sense / 2e-3
    return slope * (1.0 + z) * p[JOINT_RADIUS] / (2.0 * p[PRESLIDING_DISTANCE])


@compiled
def reserve(p: Array, q: float, z: float, sense: float) -> float:
    """Tip motion in rad that the release of the friction can still carry, from state `z` sense."""
    carried = 0.0
    step = 0.05
    while z > -1.0:
        middle = z - 0.5 * step
        gain = release_gain(p, q, middle, sense)
        if gain <= _RELEASED:
            break
        slope = gain * 2.0 * p[PRESLIDING_DISTANCE] / (p[JOINT_RADIUS] * (1.0 + middle))
        carried += slope * step * (gain - 1.0) / (2.0 * gain)
        z -= step
    return carried


@compiled
def distance_to_reversal(speed: float, acceleration: float, jerk: float) -> float:
    """Way in rad that is left to the turning point, infinite where none is ahead.

    The desired motion is continued as the harmonic that has its speed, acceleration and jerk:
    ``w^2 = -jerk / speed``, amplitude ``sqrt(speed^2 / w^2 + acceleration^2 / w^4)``; with `w`
    within [0.2, 3] rad/s, where it goes over into the parabola ``speed^2 / (2 |acceleration|)``.
    """
    if speed * acceleration >= 0.0:
        return math.inf
    w2 = min(_FASTEST, max(_SLOWEST, -jerk / speed))
    reached = abs(acceleration) / w2
    return math.sqrt(speed * speed / w2 + reached * reached) - reached


@compiled
def law_step(
    p: Array,
    memory: Array,
    angle: float,
    speed: float,
    model_tip: float,
    model_slide: float,
    lead: float,
    turn_lead: float,
    share: float,
    dt: float,
) -> float:
    """Command in rad, joint-equivalent, for this tick.

    Parameters
    ----------
    p : array (parameters,)
        Of the plant.
    memory : array (MEMORY,)
        Changed in place.
    angle, speed : float
        Desired angle and speed, rad and rad/s.
    model_tip, model_slide : float
        Tip angle (rad) and state `z` of the internal model.
    lead : float
        s by which the desired motion is foreseen: the servo's lag.
    turn_lead : float
        s before the turning point at which the last of the dead zone is crossed.
    share : float
        Of the predicted reserve that may be used, 0 for none.
    dt : float
        s since the last step.
    """
    acceleration = memory[ACCELERATION]
    rate = (speed - memory[SPEED_BEFORE]) / dt
    acceleration += (rate - acceleration) * min(1.0, dt / _ACCELERATION_TIME)
    change = (acceleration - memory[ACCELERATION]) / dt
    memory[JERK] += (change - memory[JERK]) * min(1.0, dt / _JERK_TIME)
    memory[ACCELERATION] = acceleration
    memory[SPEED_BEFORE] = speed
    foreseen = angle + lead * speed + 0.5 * lead * lead * acceleration
    speed_then = speed + lead * acceleration
    moved = (foreseen - memory[FORESEEN]) / p[JOINT_PRESLIDING]
    way = 1.0 if moved > 0.0 else -1.0
    zj = way - (way - memory[JOINT_MEMORY]) * math.exp(-abs(moved))
    memory[JOINT_MEMORY] = zj
    memory[FORESEEN] = foreseen
    memory[REFRAIN] -= dt

    sense = memory[SENSE]
    turning = speed + turn_lead * acceleration
    ahead = angle + turn_lead * speed
    turn = min(max(memory[TURN], ahead - COUNT), ahead + COUNT)
    turned_back = (turn - memory[TURN]) * sense < 0.0
    memory[TURN] = turn
    memory[FASTEST] = max(memory[FASTEST], speed * sense)
    slowed = memory[FASTEST] - speed * sense > _SPEED_NOISE
    turns = sense == 0.0 or slowed or turned_back
    if turns and abs(turning) > _STILL and turning * sense <= 0.0:
        sense = 1.0 if turning > 0.0 else -1.0
        memory[SENSE] = sense
        memory[RELEASING] = 0.0
        memory[FASTEST] = speed * sense
    behind = (angle - model_tip) * sense
    if memory[RELEASING] > 0.5 and behind > _GIVE_UP:
        memory[RELEASING] = 0.0
        memory[REFRAIN] = _REFRAIN

    if memory[RELEASING] < 0.5:
        # After a kick the joint's friction has been turned round too and must be pushed through.
        needed = min(1.0, max(0.0, behind / _PUSH_THROUGH))
        zj += (sense - zj) * needed
        target = foreseen + equilibrium_stretch(p, foreseen, speed_then, sense, zj)
        if slowed and share > 0.0 and memory[REFRAIN] <= 0.0 and speed * sense > _STILL:
            left = distance_to_reversal(speed, acceleration, memory[JERK])
            if left < share * reserve(p, angle, model_slide * sense, sense):
                memory[RELEASING] = 1.0
    else:
        target = memory[TARGET]
        gain = release_gain(p, angle, model_slide * sense, sense)
        step = (speed_then + _RELEASE_GAIN * (angle - model_tip)) * dt
        if gain > 1.0 and step * sense > 0.0:
            target -= min(_STEEPEST_RELEASE, (gain + 1.0) / (gain - 1.0)) * step
    memory[TARGET] = target
    return target
