"""Parameters of the plant from one calibration, from wire tensions alone or with the angle."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from endoscope_core.control.physical_parameters import PhysicalParameters
from endoscope_core.errors import EndoscopeError
from endoscope_core.physics import JointParameters, PlantDescription, simulate
from endoscope_core.physics.family import CENTRE, shipped_family
from endoscope_core.rig import shipped_rig

Array = NDArray[np.float64]

FITTED = {
    'capstan_exponent': 1.0,
    'pretension': 0.05,
    'wire_stiffness': 0.1,
    'joint_stiffness': 0.1,
    'joint_friction': 0.1,
    'joint_presliding': 0.15,
}
"""What is fitted, and the standard deviation of its logarithm from instrument to instrument."""

TENSION_SCALE = 0.05
BENDING_SCALE = float(np.deg2rad(0.5))
EXPONENT_BOUNDS = (0.02, 4.5)
SHAPED = {'joint_rest_angle': 0.1, 'pretension_profile': 0.15, 'friction_profile': 0.3}
"""What is fitted as it is: where the joint rests, how the wires were tightened, and where along the
sheath friction is."""
CALIBRATION_SAMPLES_NEEDED = 3500
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
) -> PlantFit:
    """Fit the nominal plant of one joint to a motion from rest, sampled at 1 kHz.

    The tensions at the motor hold the friction and, through it, the tip: how they rise and fall at
    a reversal shows the exponent and the wire's stiffness, where they stop rising the joint begins
    to move. All parameters enter through the simulation: bounded trust-region least
    squares (Branch, Coleman and Li 1999) on their logarithms, with priors of the width that
    `FITTED` says, from the best of five capstan exponents. Radii and servo are not fitted but the
    rig's: that of the shipped family, or the nominal one where it explains the tensions better. It
    is deterministic; the optimum is smooth and single once the exponent is near, which a genetic
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
        Where the search begins and what the priors are about; both rigs if not given.

    Raises
    ------
    PlantFitError
        If shapes are wrong, a command or tension is not finite, there is less than a second, or the
        command moves by less than 20 deg.
    """
    u, wires, angle = _checked(command, tension, bending)
    if start is not None:
        return _fit_about(start, u, wires, angle)
    rigs = (shipped_family().joint(CENTRE), JointParameters())
    return min((_fit_about(rig, u, wires, angle) for rig in rigs), key=lambda fit: fit.tension_rmse)


def _fit_about(first: JointParameters, u: Array, wires: Array, angle: Array) -> PlantFit:
    names = tuple(FITTED)
    spreads = np.array([FITTED[name] for name in names])
    shapes = np.array(list(SHAPED.values()))
    gear = shipped_rig().joints.gear
    ticks = len(u) // _SAMPLES_A_TICK
    held = gear * u[: ticks * _SAMPLES_A_TICK].reshape(ticks, -1).mean(axis=1)
    scored = slice(None, None, _SCORED_EVERY)
    rows = slice(None, ticks * _SAMPLES_A_TICK, _SAMPLES_A_TICK * _SCORED_EVERY)
    seen = np.isfinite(angle[rows])

    def physical(x: Array) -> PhysicalParameters:
        factors = np.exp(x[: len(names)]).tolist()
        scaled = {n: getattr(first, n) * f for n, f in zip(names, factors, strict=True)}
        tight = min(1.0, max(-1.0, first.pretension_profile + float(x[-2])))
        joint = replace(
            first,
            joint_rest_angle=first.joint_rest_angle + float(x[-3]),
            pretension_profile=tight,
            friction_profile=(float(x[-1]), *first.friction_profile[1:]),
            **scaled,
        )
        return PhysicalParameters(joint)

    def misfits(x: Array) -> tuple[Array, Array]:
        plant = PlantDescription(joints={_JOINT: physical(x).joint})
        made = simulate(plant, held[:, None], _TICK)
        wires_off = (made.tension[scored, 0] - wires[rows]).ravel()
        return wires_off, (made.bending_true[scored, 0] - angle[rows])[seen]

    expected = np.zeros(len(names) + len(SHAPED))
    expected[-1] = first.friction_profile[0] if first.friction_profile else 0.0

    def residuals(x: Array) -> Array:
        wires_off, angle_off = misfits(x)
        unlikely = (x - expected) / np.concatenate([spreads, shapes])
        return np.concatenate([wires_off / TENSION_SCALE, angle_off / BENDING_SCALE, unlikely])

    tried = []
    for exponent in _STARTS:
        x = expected.copy()
        x[0] = np.log(exponent / max(first.capstan_exponent, 1e-3))
        tried.append(x)
    begin = min(tried, key=lambda x: float(np.sum(residuals(x)[: -len(x)] ** 2)))
    reach = np.log(np.array(EXPONENT_BOUNDS) / max(first.capstan_exponent, 1e-3))
    wide = expected[1:] + 3.0 * np.concatenate([spreads[1:], shapes])
    narrow = 2.0 * expected[1:] - wide
    low, high = np.append(reach[0], narrow), np.append(reach[1], wide)
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
    command: ArrayLike, tension: ArrayLike, samples: int = CALIBRATION_SAMPLES_NEEDED
) -> tuple[PhysicalParameters, ...]:
    """Plants of all joints from the beginning of a calibration, the joints side by side.

    Parameters
    ----------
    command : array_like, shape (N,)
        Joint-equivalent motor command of every joint at 1 kHz, rad.
    tension : array_like, shape (N, 2 J)
        Positive and negative wire of each joint in turn, N.
    samples : int
        How many of the samples to use: the way to one side and back shows all that there is.

    Raises
    ------
    PlantFitError
        If the recording shows no plant.
    """
    u = np.asarray(command, dtype=float)[:samples]
    wires = np.asarray(tension, dtype=float)[:samples]
    pairs = [wires[:, j : j + 2] for j in range(0, wires.shape[1], 2)]
    # The simulation lets go of the interpreter: two joints take two cores.
    with ThreadPoolExecutor(len(pairs)) as pool:
        fits = list(pool.map(lambda pair: fit_plant(u, pair), pairs))
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
