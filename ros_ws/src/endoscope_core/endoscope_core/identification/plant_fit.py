"""Parameters of the plant from one calibration, from wire tensions alone or with the angle."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from endoscope_core.control.physical_parameters import PhysicalParameters
from endoscope_core.errors import EndoscopeError
from endoscope_core.physics import JointParameters, PlantDescription, simulate
from endoscope_core.physics.family import CENTRE, MOST_BENT, shipped_family

Array = NDArray[np.float64]

FITTED = {
    'capstan_exponent': 1.0,
    'pretension': 0.05,
    'wire_stiffness': 0.1,
    'joint_stiffness': 0.1,
    'joint_friction': 0.1,
    'joint_presliding': 0.15,
}
"""What is fitted, and the standard deviation of its logarithm from instrument to instrument in
tubes of one bend."""

TENSION_SCALE = 0.05
BENDING_SCALE = float(np.deg2rad(0.5))
EXPONENT_BOUNDS = (0.02, 4.5)
SHAPED = {'joint_rest_angle': 0.1, 'pretension_profile': 0.15, 'friction_profile': 0.3}
"""What is fitted as it is: where the joint rests, how the wires were tightened, and where along the
sheath friction is."""
BENDS = (0.5 * MOST_BENT, MOST_BENT / math.sqrt(12.0))
"""Mean and standard deviation of the bend of a tube, rad: any that the family has is as likely."""
_STARTS = (0.25, 0.6, 1.0, 1.5, 2.1)
_SAMPLES_A_TICK = 5
_TICK = 5.0e-3
_SCORED_EVERY = 2
_SHORTEST = 1000
_SMALLEST_MOTION = float(np.deg2rad(20.0))
_JOINT = 'bend_x'


class PlantFitError(EndoscopeError, ValueError):
    """A recording from which the plant cannot be identified."""


@dataclass(frozen=True)
class PlantFit:
    """Identified parameters of one joint.

    Parameters
    ----------
    parameters : PhysicalParameters
    tension_rmse : float
        N, of both wires.
    bending_rmse : float or None
        rad; None where no angle was given.
    evaluations : int
        Simulations that it took.
    """

    parameters: PhysicalParameters
    tension_rmse: float
    bending_rmse: float | None
    evaluations: int


def fit_plant(
    command: ArrayLike,
    tension: ArrayLike,
    bending: ArrayLike | None = None,
    start: JointParameters | None = None,
    *,
    gear: float,
) -> PlantFit:
    """Fit the nominal plant of one joint to a motion from rest, sampled at 1 kHz.

    The tensions at the motor hold the friction and, through it, the tip: how they rise and fall at
    a reversal shows the exponent and the wire's stiffness, where they stop rising the joint begins
    to move. All parameters enter through the simulation: bounded trust-region least
    squares (Branch, Coleman and Li 1999) on their logarithms, from the best of five capstan
    exponents. What bending the tube changes goes along the lines of the shipped family, with the
    bend as one more unknown; about them are priors of the width that `FITTED` says. Radii and servo
    are not fitted but the family's, or nominal where the nominal rig explains the tensions better.
    It is deterministic; the optimum is smooth and single once the exponent is near, which a genetic
    algorithm would find a hundred times slower.

    Parameters
    ----------
    command : array_like, shape (N,)
        Joint-equivalent motor command in rad.
    tension : array_like, shape (N, 2)
        Load cells of the positive and the negative wire, N.
    bending : array_like, shape (N,), optional
        Bending angle in rad; NaN where there is none.
    start : JointParameters, optional
        Where the search begins and what the priors are about; the family and the nominal rig if
        not given.
    gear : float
        Shaft angle for one radian at the joint.

    Raises
    ------
    PlantFitError
        If shapes are wrong, a command or tension is not finite, there is less than a second, or the
        command moves by less than 20 deg.
    """
    u, wires, angle = _checked(command, tension, bending)
    if start is not None:
        return _fit_about(_whatever_the_bend(start), gear * u, wires, angle)
    rigs = shipped_family().joint, _whatever_the_bend(JointParameters())
    fits = (_fit_about(rig, gear * u, wires, angle) for rig in rigs)
    return min(fits, key=lambda fit: fit.tension_rmse)


def _whatever_the_bend(joint: JointParameters) -> Callable[[float], JointParameters]:
    return lambda bend: joint


def _fit_about(
    in_tube: Callable[[float], JointParameters], shaft: Array, wires: Array, angle: Array
) -> PlantFit:
    names = tuple(FITTED)
    first = in_tube(CENTRE)
    ticks = len(shaft) // _SAMPLES_A_TICK
    held = shaft[: ticks * _SAMPLES_A_TICK].reshape(ticks, -1).mean(axis=1)
    scored = slice(None, None, _SCORED_EVERY)
    rows = slice(None, ticks * _SAMPLES_A_TICK, _SAMPLES_A_TICK * _SCORED_EVERY)
    seen = np.isfinite(angle[rows])

    def physical(x: Array) -> PhysicalParameters:
        middle = in_tube(min(MOST_BENT, max(0.0, float(x[-1]))))
        factors = np.exp(x[: len(names)]).tolist()
        scaled = {n: getattr(middle, n) * f for n, f in zip(names, factors, strict=True)}
        tight = min(1.0, max(-1.0, middle.pretension_profile + float(x[-3])))
        joint = replace(
            middle,
            joint_rest_angle=middle.joint_rest_angle + float(x[-4]),
            pretension_profile=tight,
            friction_profile=(float(x[-2]), *middle.friction_profile[1:]),
            **scaled,
        )
        return PhysicalParameters(joint)

    def misfits(x: Array) -> tuple[Array, Array]:
        plant = PlantDescription(joints={_JOINT: physical(x).joint})
        made = simulate(plant, held[:, None], _TICK)
        wires_off = (made.tension[scored, 0] - wires[rows]).ravel()
        return wires_off, (made.bending_true[scored, 0] - angle[rows])[seen]

    expected = np.zeros(len(names) + len(SHAPED) + 1)
    expected[-2] = first.friction_profile[0] if first.friction_profile else 0.0
    expected[-1] = BENDS[0]
    deviations = np.concatenate([list(FITTED.values()), list(SHAPED.values()), BENDS[1:]])

    def residuals(x: Array) -> Array:
        wires_off, angle_off = misfits(x)
        unlikely = (x - expected) / deviations
        return np.concatenate([wires_off / TENSION_SCALE, angle_off / BENDING_SCALE, unlikely])

    def begin_at(exponent: float) -> Array:
        x = expected.copy()
        x[0] = math.log(exponent / max(in_tube(BENDS[0]).capstan_exponent, 1e-3))
        return x

    tried = [begin_at(exponent) for exponent in _STARTS]
    begin = min(tried, key=lambda x: float(np.sum(residuals(x)[: -len(x)] ** 2)))
    low, high = expected - 3.0 * deviations, expected + 3.0 * deviations
    low[0], high[0] = (begin_at(exponent)[0] for exponent in EXPONENT_BOUNDS)
    low[-1], high[-1] = 0.0, MOST_BENT
    found = least_squares(
        residuals, begin, bounds=(low, high), diff_step=1e-3, xtol=1e-4, ftol=1e-4, max_nfev=15
    )
    wires_off, angle_off = misfits(found.x)
    return PlantFit(
        physical(found.x),
        float(np.sqrt(np.mean(wires_off**2))),
        float(np.sqrt(np.mean(angle_off**2))) if angle_off.size else None,
        len(tried) + int(found.nfev) * (1 + len(begin)),
    )


def plants_of_calibration(
    command: ArrayLike, tension: ArrayLike, gear: float
) -> tuple[PhysicalParameters, ...]:
    """Plants of all joints from a calibration, the joints side by side.

    Where friction lets the joint go to one side only a little, the way to the other shows where it
    rests: a motion to one side and back tells a tight tube's reach worse than one to both.

    Parameters
    ----------
    command : array_like, shape (N,)
        Joint-equivalent motor command of every joint at 1 kHz, rad.
    tension : array_like, shape (N, 2 J)
        Positive and negative wire of each joint in turn, N.
    gear : float
        Shaft angle for one radian at the joint.

    Raises
    ------
    PlantFitError
        If the recording shows no plant.
    """
    u = np.asarray(command, dtype=float)
    wires = np.asarray(tension, dtype=float)
    pairs = [wires[:, j : j + 2] for j in range(0, wires.shape[1], 2)]
    # The simulation lets go of the interpreter: two joints take two cores, unless the threads of
    # small matrices are in the way.
    with threadpool_limits(1, 'blas'), ThreadPoolExecutor(len(pairs)) as pool:
        fits = list(pool.map(lambda pair: fit_plant(u, pair, gear=gear), pairs))
    return tuple(fit.parameters for fit in fits)


def _checked(
    command: ArrayLike, tension: ArrayLike, bending: ArrayLike | None
) -> tuple[Array, Array, Array]:
    u = np.asarray(command, dtype=float)
    wires = np.asarray(tension, dtype=float)
    angle = np.full(u.shape, np.nan) if bending is None else np.asarray(bending, dtype=float)
    if u.ndim != 1 or wires.shape != (u.size, 2) or angle.shape != u.shape:
        raise PlantFitError(
            f'command {u.shape}, tension {wires.shape} and bending {angle.shape} must be (N,), '
            '(N, 2) and (N,)'
        )
    if u.size < _SHORTEST:
        raise PlantFitError(f'{u.size} samples are too few: record at least a second at 1 kHz')
    if not (np.all(np.isfinite(u)) and np.all(np.isfinite(wires))):
        raise PlantFitError('command or tension holds values that are not finite')
    if np.ptp(u) < _SMALLEST_MOTION:
        raise PlantFitError('the motor moves by less than 20 deg: record a calibration motion')
    return u, wires, angle
