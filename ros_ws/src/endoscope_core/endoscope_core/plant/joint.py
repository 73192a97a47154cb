"""Compiled physics of the bending section."""

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.effects import (
    breathing,
    contact,
    cross_coupling,
    external_load,
    gravity,
    joint_stop,
)
from endoscope_core.effects.slots import JOINT_DAMPING, JOINT_STIFFNESS
from endoscope_core.plant.inputs import IN_OTHER_JOINT, IN_PUSH_MOMENT


@compiled
def load(
    p: Array,
    on: Flags,
    x: Array,
    q: float,
    time: float,
    tick: float,
) -> tuple[float, float, float]:
    """Moment in N m of all but wires, friction and damping; minus its slope by the angle; damping.

    Damping is the coefficient in N m s/rad of the moments against the joint's speed.
    """
    moment = x[IN_PUSH_MOMENT] - p[JOINT_STIFFNESS] * q
    slope = p[JOINT_STIFFNESS]
    damping = p[JOINT_DAMPING]
    if on[joint_stop.ON]:
        added, steeper = joint_stop.moment_and_slope(p, q)
        moment += added
        slope += steeper
        damping += p[joint_stop.LOSS] * abs(added)
    if on[contact.ON]:
        added, steeper = contact.moment_and_slope(p, q)
        moment += added
        slope += steeper
        damping += p[contact.LOSS] * abs(added)
    if on[gravity.ON]:
        added, steeper = gravity.moment_and_slope(p, q)
        moment += added
        slope += steeper
    if on[external_load.ON]:
        moment += external_load.mean_moment(p, time, tick)
    if on[cross_coupling.ON]:
        moment += cross_coupling.moment(p, x[IN_OTHER_JOINT])
    if on[breathing.ON]:
        moment += breathing.moment(p, time)
    return moment, slope, damping
