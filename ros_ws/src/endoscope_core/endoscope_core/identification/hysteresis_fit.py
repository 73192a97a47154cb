"""Hysteresis models of the transmission, fitted to recordings of it.

Equations 3 and 4, driven by the motor, are what a recording shows. The inverse drives `h` by the
desired angle: its parameters are chosen on this model in a second step, see `feedforward_fit`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution, lsq_linear

from endoscope_core.errors import InputError
from endoscope_core.hysteresis import (
    BoucWenParameters,
    DahlParameters,
    HysteresisParameters,
    forward,
)
from endoscope_core.hysteresis.bouc_wen import bouc_wen_path
from endoscope_core.hysteresis.dahl import dahl_path
from endoscope_core.hysteresis.memory_model import (
    GREATEST_ALPHA,
    GREATEST_INVERSE_SLOPE,
    GREATEST_LAG,
    GREATEST_OFFSET,
    SMALLEST_ALPHA,
)

Array = NDArray[np.float64]

SHORTEST_TRAVEL = float(np.deg2rad(2.0))
LONGEST_TRAVEL = float(np.deg2rad(90.0))
TRAVEL_BOUNDS = (float(np.log(SHORTEST_TRAVEL)), float(np.log(LONGEST_TRAVEL)))
RHO_BOUNDS = (-0.95, 1.0)
EXPONENT_BOUNDS = (1.0, 4.0)
LAG_BOUNDS = (0.0, GREATEST_LAG)
ALPHA_BOUNDS = (SMALLEST_ALPHA, GREATEST_ALPHA)
# What is rounded for a file must still pass the limit.
_SLOPE = 0.99 * GREATEST_INVERSE_SLOPE
_SMALLEST_MOTION = float(np.deg2rad(1.0))


@dataclass(frozen=True)
class ModelFamily:
    """How a model is fitted by variable projection (Golub and Pereyra 1973)."""

    shape_bounds: tuple[tuple[float, float], ...]  # of the parameters that are searched
    path: Callable[[Array, float, Array], Array]  # from driver, y0 and shape to y (N,)
    # From shape, factors and offset; safe whatever they are within their bounds: where the inverse
    # would be too steep, the travel is lengthened.
    build: Callable[[Array, Array, float], HysteresisParameters]
    has_offset: bool  # of the model itself


def _travel(log_travel: float, alpha: float, lag: float, steepest: float) -> float:
    """Travel that was searched, or the shortest that keeps the inverse's slope."""
    return float(max(np.exp(log_travel), steepest * lag / (_SLOPE * alpha - 1.0)))


def _bouc_wen(shape: Array, factors: Array, offset: float) -> BoucWenParameters:
    (alpha, lag), rho = factors.tolist(), float(shape[1])
    travel = _travel(shape[0], alpha, lag, max(1.0, 1.0 + rho))
    return BoucWenParameters.from_shape(alpha, lag, travel, rho, float(shape[2]))


def _dahl(shape: Array, factors: Array, offset: float) -> DahlParameters:
    (alpha, lag), exponent = factors.tolist(), float(shape[1])
    travel = _travel(shape[0], alpha, lag, 2.0**exponent)
    return DahlParameters(
        alpha, lag, travel, exponent, float(np.clip(offset, -GREATEST_OFFSET, GREATEST_OFFSET))
    )


FAMILIES: dict[str, ModelFamily] = {
    'bouc_wen': ModelFamily(
        (TRAVEL_BOUNDS, RHO_BOUNDS, EXPONENT_BOUNDS),
        lambda driver, y0, s: bouc_wen_path(driver, y0, np.exp(s[0]), s[1], s[2]),
        _bouc_wen,
        has_offset=False,
    ),
    'dahl': ModelFamily(
        (TRAVEL_BOUNDS, (0.5, 4.0)),
        lambda driver, y0, s: dahl_path(driver, y0, np.exp(s[0]), s[1]),
        _dahl,
        has_offset=True,
    ),
}


@dataclass(frozen=True)
class HysteresisRecording:
    """Motor and joint of one recording (N,) in rad, evenly sampled."""

    driver: Array  # joint-equivalent motor angle in rad
    actual: Array  # bending angle in rad
    rested: bool = True  # whether it begins at rest and without memory, so that `h` begins at zero

    def centred(self, values: Array) -> Array:
        """Values (N, ...) less their mean."""
        return values - np.mean(values, axis=0)


@dataclass(frozen=True)
class ModelFit:
    """A model of a transmission."""

    parameters: HysteresisParameters
    rmse: float  # rad, of modelled less measured angle, an offset of each recording removed
    model: str = 'bouc_wen'  # name of the model
    # rad, measured less modelled angle, mean of the recordings; part of the parameters where the
    # model has an offset.
    offset: float = 0.0

    def __str__(self) -> str:
        rows = [f'  {name:<12}{value:10.4f}' for name, value in self.parameters.to_dict().items()]
        return '\n'.join([f'{self.model}, {np.rad2deg(self.rmse):.2f} deg rms', *rows])

    def predict(self, driver: Array, y0: float = 0.0) -> Array:
        """Actual angle (N,) in rad for a driving angle (N,), offset included.

        `y0` is the memory at the first sample.
        """
        missing = 0.0 if FAMILIES[self.model].has_offset else self.offset
        return forward(self.parameters, driver, y0) + missing


def fit_model(
    recordings: Sequence[HysteresisRecording], seed: int = 0, model: str = 'bouc_wen'
) -> ModelFit:
    """Fit a hysteresis model to one or more recordings (rad) of the same tube or class.

    What comes out is safe by construction: the boxes are those of the parameter classes, and where
    the inverse would be too steep the travel is lengthened. InputError if the model is
    unknown, there is no recording, one is empty or not finite, or the motor or the joint hardly
    moves.
    """
    _check(recordings)
    if model not in FAMILIES:
        raise InputError(f'unknown model {model!r}: choose one of {", ".join(FAMILIES)}')
    family = FAMILIES[model]
    starts = [k for k, recording in enumerate(recordings) if not recording.rested]
    size = len(family.shape_bounds)

    def memories(x: Array) -> list[Array]:
        first = np.zeros(len(recordings))
        first[starts] = x[size:]
        return [
            family.path(recording.driver, y0, x[:size])
            for recording, y0 in zip(recordings, first.tolist(), strict=True)
        ]

    def cost(x: Array) -> float:
        return _linear_part(recordings, memories(x))[1]

    # For given shape and initial memory, the gain, the lag and an offset for each recording enter
    # linearly and follow from bounded least squares (variable projection, Golub and Pereyra 1973):
    # two or three are left. Differential evolution (Storn and Price 1997) needs no start and
    # does not stay in the local minima that sharpness and travel make; L-BFGS-B then refines it.
    found = differential_evolution(
        cost,
        [*family.shape_bounds, *[(-1.0, 1.0)] * len(starts)],
        rng=np.random.default_rng(seed),
        popsize=8,
        maxiter=60,
        tol=1e-5,
    )
    factors, _ = _linear_part(recordings, memories(found.x))
    first = np.zeros(len(recordings))
    first[starts] = found.x[size:]
    bare = family.build(found.x[:size], factors, 0.0)
    residuals = [
        r.actual - forward(bare, r.driver, y0)
        for r, y0 in zip(recordings, first.tolist(), strict=True)
    ]
    offset = float(np.mean([np.mean(residual) for residual in residuals]))
    centred = [r.centred(residual) for r, residual in zip(recordings, residuals, strict=True)]
    spread = np.mean(np.concatenate(centred) ** 2)
    parameters = family.build(found.x[:size], factors, offset if family.has_offset else 0.0)
    return ModelFit(parameters, float(np.sqrt(spread)), model, offset)


def _linear_part(
    recordings: Sequence[HysteresisRecording], memories: Sequence[Array]
) -> tuple[Array, float]:
    """Best gain and lag, and the mean square that they leave."""
    columns = [np.stack([r.driver, -y], axis=1) for r, y in zip(recordings, memories, strict=True)]
    target = np.concatenate([r.centred(r.actual) for r in recordings])
    matrix = np.concatenate([r.centred(c) for r, c in zip(recordings, columns, strict=True)])
    gram = matrix.T @ matrix + 1e-12 * np.eye(matrix.shape[1])
    side = matrix.T @ target
    solution = np.linalg.solve(gram, side)
    low, high = np.array((ALPHA_BOUNDS, LAG_BOUNDS)).T
    if np.any(solution < low) or np.any(solution > high):
        root = np.linalg.cholesky(gram).T
        solution = lsq_linear(root, np.linalg.solve(root.T, side), (low, high)).x
        solution = np.clip(solution, low, high)
    return solution, float(np.mean((target - matrix @ solution) ** 2))


def _check(recordings: Sequence[HysteresisRecording]) -> None:
    if not recordings:
        raise InputError('there is no recording to identify from')
    for k, recording in enumerate(recordings):
        for name, values in (('motor', recording.driver), ('bending', recording.actual)):
            if len(values) < 100 or not np.all(np.isfinite(values)):
                raise InputError(
                    f'recording {k}: the {name} angle has {len(values)} samples, of which all must '
                    'be finite and at least 100 there'
                )
            if np.ptp(values) < _SMALLEST_MOTION:
                raise InputError(
                    f'recording {k}: the {name} angle moves by less than 1 deg, which shows no '
                    'hysteresis; record a calibration or commissioning motion'
                )
        if len(recording.driver) != len(recording.actual):
            raise InputError(f'recording {k}: motor and bending differ in length')
