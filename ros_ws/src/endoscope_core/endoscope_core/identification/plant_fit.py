"""Parameters of the plant from one calibration, from wire tensions alone or with the angle."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import OptimizeResult, least_squares
from threadpoolctl import threadpool_limits

from endoscope_core.control.internal_model import PhysicalParameters
from endoscope_core.errors import EndoscopeError
from endoscope_core.metrics import NoLoopError, width_at_mid_height
from endoscope_core.physics import JointParameters, PlantDescription, simulate
from endoscope_core.physics.description import SLAVE
from endoscope_core.physics.effects import KNOWN
from endoscope_core.physics.family import CENTRE, MOST_BENT, shipped_family
from endoscope_core.signals import CALIBRATION_RATE, calibration_motion

Array = NDArray[np.float64]

_RATE, _, _SPAN = KNOWN['pretension_loss'].parameters
_LOSS_N = _RATE.typical * _SPAN.typical
FITTED = {
    'capstan_exponent': 1.0,
    'pretension': -math.log1p(-_LOSS_N / SLAVE.pretension),
    'wire_stiffness': 0.1,
    'joint_stiffness': 0.1,
    'joint_friction': 0.1,
    'joint_presliding': 0.15,
    'section_friction': 0.1,
}
"""What is fitted, and the standard deviation of its logarithm from instrument to instrument in
tubes of one bend; of the pretension, which creeps and is tightened again by hand, that of the
nominal rig after a typical loss."""

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
_GEAR = 0.5
"""Of the rigs whose pulleys are known."""
_DEVIATIONS = np.array([*FITTED.values(), *SHAPED.values(), BENDS[1]])
_FTOL = 1e-3
"""Share of the cost by which a last step lowers it: a good fit of 9 s costs 144, and a number that
is off by its standard deviation a half more."""
_EVALUATIONS = 15


class PlantFitError(EndoscopeError, ValueError):
    """A recording from which the plant cannot be identified."""


@dataclass(frozen=True)
class PlantFit:
    """Identified parameters of one joint, with what they leave in N and rad."""

    parameters: PhysicalParameters
    tension_rmse: float  # N, of both wires
    bending_rmse: float | None  # rad; None where no angle was given


def fit_plant(
    command: ArrayLike,
    tension: ArrayLike,
    bending: ArrayLike | None = None,
    start: JointParameters | None = None,
    *,
    gear: float,
) -> PlantFit:
    """Fit the nominal plant of one joint to a motion from rest, sampled at 1 kHz.

    The `command` (N,) in rad is joint-equivalent, `tension` (N, 2) in N that of the positive and
    the negative wire, `bending` (N,) in rad NaN where there is none, `gear` the shaft angle for one
    radian at the joint. The search begins at `start`, about which the priors are; by default at the
    family and the nominal rig.

    PlantFitError if shapes are wrong, a command or tension is not finite, there is less than a
    second, or the command moves by less than 20 deg.
    """
    # How the tensions rise and fall at a reversal shows the exponent and the wire's stiffness;
    # where they stop rising the joint begins to move. Bounded trust-region least squares (Branch,
    # Coleman and Li 1999) on the parameters' logarithms, from the best of five capstan exponents:
    # the optimum is smooth and single once the exponent is near. What bending the tube changes goes
    # along the lines of the shipped family, with the bend as one more unknown, about them priors of
    # the width that `FITTED` says. Radii and servo are the family's, or nominal where the nominal
    # rig explains the tensions better. Where the gear is another, so is the pulley, which pulls as
    # much wire for a radian at the joint: tensions alone would take it for other stiffness.
    u, wires, angle = _checked(command, tension, bending)
    if start is not None:
        rigs = [_whatever_the_bend(start)]
    else:
        known = (shipped_family().joint, _whatever_the_bend(SLAVE))
        rigs = [_with_pulley(rig, _GEAR / gear) for rig in known]
    searches = [_Search.of(rig, gear * u, wires, angle) for rig in rigs]
    ends = [(search, search.fitted()) for search in searches]
    search, found = min(ends, key=lambda pair: pair[0].tension_rmse(pair[1].x))
    wires_off, angle_off = search.misfits(found.x)
    return PlantFit(
        search.physical(found.x),
        _rms(wires_off),
        _rms(angle_off) if angle_off.size else None,
    )


def _whatever_the_bend(joint: JointParameters) -> Callable[[float], JointParameters]:
    return lambda bend: joint


def _with_pulley(
    in_tube: Callable[[float], JointParameters], factor: float
) -> Callable[[float], JointParameters]:
    def joint(bend: float) -> JointParameters:
        middle = in_tube(bend)
        return replace(middle, pulley_radius=factor * middle.pulley_radius)

    return joint


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True)
class _Search:
    """The numbers of a rig whose tubes are bent, sought from a motion."""

    in_tube: Callable[[float], JointParameters]  # the joint by the bend in rad
    held: Array  # shaft command on ticks (K,), rad
    # Where they are scored.
    wires: Array  # (M, 2), N
    angle: Array  # (M,), rad; NaN where there is none

    @classmethod
    def of(
        cls, in_tube: Callable[[float], JointParameters], shaft: Array, wires: Array, angle: Array
    ) -> _Search:
        ticks = len(shaft) // _SAMPLES_A_TICK
        held = shaft[: ticks * _SAMPLES_A_TICK].reshape(ticks, -1).mean(axis=1)
        rows = slice(None, ticks * _SAMPLES_A_TICK, _SAMPLES_A_TICK * _SCORED_EVERY)
        return cls(in_tube, held, wires[rows], angle[rows])

    @cached_property
    def expected(self) -> Array:
        """Coordinates (12,) of a rig of which nothing is known."""
        profile = self.in_tube(CENTRE).friction_profile
        expected = np.zeros(len(FITTED) + len(SHAPED) + 1)
        expected[-2] = profile[0] if profile else 0.0
        expected[-1] = BENDS[0]
        return expected

    def physical(self, x: Array) -> PhysicalParameters:
        middle = self.in_tube(min(MOST_BENT, max(0.0, float(x[-1]))))
        factors = np.exp(x[: len(FITTED)]).tolist()
        scaled = {n: getattr(middle, n) * f for n, f in zip(FITTED, factors, strict=True)}
        tight = min(1.0, max(-1.0, middle.pretension_profile + float(x[-3])))
        joint = replace(
            middle,
            joint_rest_angle=middle.joint_rest_angle + float(x[-4]),
            pretension_profile=tight,
            friction_profile=(float(x[-2]), *middle.friction_profile[1:]),
            **scaled,
        )
        return PhysicalParameters(joint)

    def misfits(self, x: Array) -> tuple[Array, Array]:
        """Of tensions in N and of the angle in rad, in a row."""
        plant = PlantDescription(joints={_JOINT: self.physical(x).joint})
        made = simulate(plant, self.held[:, None], _TICK)
        scored = slice(None, None, _SCORED_EVERY)
        seen = np.isfinite(self.angle)
        wires_off = (made.tension[scored, 0] - self.wires).ravel()
        return wires_off, (made.bending_true[scored, 0] - self.angle)[seen]

    def tension_rmse(self, x: Array) -> float:
        return _rms(self.misfits(x)[0])

    def residuals(self, x: Array) -> Array:
        wires_off, angle_off = self.misfits(x)
        unlikely = (x - self.expected) / _DEVIATIONS
        return np.concatenate([wires_off / TENSION_SCALE, angle_off / BENDING_SCALE, unlikely])

    def at_exponent(self, exponent: float) -> Array:
        x = self.expected.copy()
        x[0] = math.log(exponent / max(self.in_tube(BENDS[0]).capstan_exponent, 1e-3))
        return x

    def fitted(self) -> OptimizeResult:
        """The fit from the start that explains most."""
        tried = [self.at_exponent(exponent) for exponent in _STARTS]
        begin = min(tried, key=lambda x: float(np.sum(self.residuals(x)[: -len(x)] ** 2)))
        expected = self.expected
        low, high = expected - 3.0 * _DEVIATIONS, expected + 3.0 * _DEVIATIONS
        low[0], high[0] = (self.at_exponent(exponent)[0] for exponent in EXPONENT_BOUNDS)
        low[-1], high[-1] = 0.0, MOST_BENT
        return least_squares(
            self.residuals,
            begin,
            bounds=(low, high),
            diff_step=1e-3,
            xtol=1e-4,
            ftol=_FTOL,
            max_nfev=_EVALUATIONS,
        )


def plants_of_calibration(
    command: ArrayLike, tension: ArrayLike, gear: float
) -> tuple[PhysicalParameters, ...]:
    """Plants of all joints from a calibration, as `fits_of_calibration` finds them."""
    return tuple(fit.parameters for fit in fits_of_calibration(command, tension, gear))


def fits_of_calibration(
    command: ArrayLike, tension: ArrayLike, gear: float
) -> tuple[PlantFit, ...]:
    """Fits of all joints, side by side, to a calibration; PlantFitError if it shows no plant.

    The joint-equivalent command (N,) is in rad at 1 kHz, `gear` the shaft's angle for a radian of
    it; tensions (N, 2 J) in N are of the two wires of each joint in turn. Where friction lets the
    joint go to one side only a little, the way to the other shows where it rests.
    """
    u = np.asarray(command, dtype=float)
    wires = np.asarray(tension, dtype=float)
    pairs = [wires[:, j : j + 2] for j in range(0, wires.shape[1], 2)]
    # The simulation lets go of the interpreter: two joints take two cores, unless the threads of
    # small matrices are in the way.
    with threadpool_limits(1, 'blas'), ThreadPoolExecutor(len(pairs)) as pool:
        return tuple(pool.map(lambda pair: fit_plant(u, pair, gear=gear), pairs))


def size_of_explained(fits: Sequence[PlantFit], gear: float) -> float | None:
    """Mean backlash size in rad by plants; None where one leaves more than noise, or no loop."""
    if any(fit.tension_rmse > TENSION_SCALE for fit in fits):
        return None
    motion = calibration_motion()
    time = np.arange(motion.samples) / CALIBRATION_RATE
    angle, _ = motion.signal(time)
    joints = {f'joint_{k}': fit.parameters.joint for k, fit in enumerate(fits)}
    command = np.repeat(gear * angle[:, None], len(joints), axis=1)
    bending = simulate(PlantDescription(joints=joints), command).bending_true
    settled = time >= motion.signal.steady[0]
    try:
        widths = [width_at_mid_height(angle[settled], each[settled]) for each in bending.T]
    except NoLoopError:
        return None
    return float(np.mean(widths))


def lost_pretension(fits: Sequence[PlantFit]) -> list[float]:
    """What each joint's wires have less pretension by than the rigs that are known, N."""
    least = min(shipped_family().joint(CENTRE).pretension, SLAVE.pretension)
    return [max(0.0, least - fit.parameters.joint.pretension) for fit in fits]


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
