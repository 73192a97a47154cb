"""The instrument and the two tubes that are nearest to those of the first paper's Table 5.

The table tells of each tube how large error and backlash are without compensation, under two
motions. Nothing else is known of them: what such wires, sheaths and joints can have is searched for
the numbers that come nearest to all eight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from endoscope_core.metrics import tracking_rmse, width_at_mid_height
from endoscope_core.physics import JointParameters, PlantDescription, simulate
from endoscope_core.physics.family import shipped_family
from endoscope_core.rig import load_rig
from endoscope_core.signals import MOTIONS, motion_by_name

Array = NDArray[np.float64]

RMSE_TOLERANCE, BACKLASH_TOLERANCE = 0.05, 0.075
"""What counts as one: relative errors of RMSE and backlash."""
OF_INSTRUMENT = {
    'joint_radius': 0.3,
    'pulley_radius': 0.1,
    'wire_stiffness': 0.3,
    'pretension': 0.3,
    'joint_presliding': 0.5,
    'joint_damping': 3.0,
}
OF_TUBE = {'capstan_exponent': 0.8, 'joint_stiffness': 0.5, 'joint_friction': 0.5}
"""How far from the recorded family each number may be, as a deviation of its logarithm."""
REST_DEVIATION = 0.2
PRIOR_WEIGHT = 0.3
_BENDS_DEG = (60.0, 200.0)
_TICK = 2.5e-3


@dataclass(frozen=True)
class Uncompensated:
    """RMSE and backlash size in rad under one motion."""

    rmse: float
    backlash: float


def uncompensated(joint: JointParameters, motion: str) -> Uncompensated:
    """What one joint leaves of a named motion without compensation.

    Raises
    ------
    ValueError
        If there is no motion of that name, or the joint shows no loop.
    """
    signal = motion_by_name(motion)
    time = np.arange(0.0, signal.duration, _TICK)
    desired, _ = signal.joints['bend_x'](time)
    command = load_rig().joints.gear * desired[:, None]
    angle = simulate(PlantDescription({'bend_x': joint}), command, _TICK).bending_true[:, 0]
    steady = (time >= signal.steady[0]) & (time <= signal.steady[1])
    return Uncompensated(
        tracking_rmse(desired[steady], angle[steady]),
        abs(width_at_mid_height(desired[steady], angle[steady])),
    )


def nearest_tubes(paper: Array) -> tuple[JointParameters, ...]:
    """Find the two tubes.

    Parameters
    ----------
    paper : array (2, 4)
        Of each tube RMSE and backlash in rad under each of the two motions of `MOTIONS` in turn.

    Returns
    -------
    tuple of JointParameters
    """
    deviations = np.array(
        [*OF_INSTRUMENT.values(), *OF_TUBE.values(), *OF_TUBE.values(), REST_DEVIATION]
    )
    tolerance = np.array([RMSE_TOLERANCE, BACKLASH_TOLERANCE] * 2)

    def misfit(x: Array) -> Array:
        made = np.array([figures(joint) for joint in _tubes(x)])
        return np.append(((made / paper - 1.0) / tolerance).ravel(), PRIOR_WEIGHT * x / deviations)

    found = least_squares(
        misfit, np.zeros(len(deviations)), x_scale=deviations, diff_step=3e-3, max_nfev=20
    )
    return _tubes(found.x)


def figures(joint: JointParameters) -> list[float]:
    """RMSE and backlash in rad under each of the paper's motions in turn."""
    seen = [uncompensated(joint, motion) for motion in PAPER_MOTIONS]
    return [value for each in seen for value in (each.rmse, each.backlash)]


PAPER_MOTIONS = tuple(name for name in ('periodic', 'non_periodic') if name in MOTIONS)


def _tubes(x: Array) -> tuple[JointParameters, ...]:
    factors = np.exp(x[:-1]).tolist()
    common = dict(zip(OF_INSTRUMENT, factors, strict=False))
    tubes = []
    for number, bend_deg in enumerate(_BENDS_DEG):
        base = shipped_family().joint(float(np.deg2rad(bend_deg)))
        own = factors[len(OF_INSTRUMENT) + number * len(OF_TUBE) :]
        scales = common | dict(zip(OF_TUBE, own, strict=False))
        scaled = {key: getattr(base, key) * factor for key, factor in scales.items()}
        tubes.append(replace(base, joint_rest_angle=float(x[-1]), **scaled))
    return tuple(tubes)
