"""Models on recordings of a real flexible endoscope, if they are available.

The recordings (sine of 60 deg in five tubes, about two cycles) are not part of this project. They
are searched in ``data/kaist`` of the folder that ENDOSCOPE_SHARED names.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from endoscope_core.identification import HysteresisRecording, fit_model
from endoscope_core.metrics import width_at_mid_height
from endoscope_lab.identification.family_fit import (
    ACTUAL,
    CYCLE_S,
    DESIRED,
    FITTED_CYCLES,
    NEGATIVE,
    PHASE,
    POSITIVE,
)

Array = NDArray[np.float64]

_SETTLED = (0.5 * np.pi, 2.5 * np.pi)


@dataclass(frozen=True)
class RealRecording:
    """One tube, N samples."""

    bend: int  # of the tube, deg
    phase: Array  # (N,), rad, which at 0.159 Hz is s
    desired: Array  # (N,), rad
    actual: Array  # (N,), rad
    tension: Array  # (N, 2), N

    def within(self, begin: float, end: float) -> slice:
        """Samples between two phases in rad."""
        first, last = np.searchsorted(self.phase, (begin, end))
        return slice(int(first), int(last))

    @property
    def backlash_size(self) -> float:
        """Width in rad of the settled loop."""
        loop = self.within(*_SETTLED)
        return width_at_mid_height(self.desired[loop], self.actual[loop])

    @property
    def tension_width(self) -> float:
        """Width of the settled loop of the tensions, without the actual angle."""
        loop = self.within(*_SETTLED)
        tension = self.tension[loop]
        return float(
            tension_loop_width(np.rad2deg(self.desired[loop]), tension[:, 0], tension[:, 1])
        )


def recordings_folder() -> Path | None:
    """Folder of the recordings; None if it does not exist."""
    shared = os.environ.get('ENDOSCOPE_SHARED')
    folder = Path(shared or Path(__file__).parents[6] / 'shared') / 'data' / 'kaist'
    return folder if folder.is_dir() else None


def real_recordings(folder: Path | None = None) -> list[RealRecording]:
    """All recordings, sorted by the bend of the tube; empty if they are not available."""
    folder = folder or recordings_folder()
    if folder is None:
        return []
    found = []
    # Tubes are named by their bend; other files of the folder have another format.
    for path in folder.glob('[0-9]*.txt'):
        table = without_repeats(np.loadtxt(path, delimiter=','))
        found.append(
            RealRecording(
                int(path.stem),
                table[:, PHASE],
                np.deg2rad(table[:, DESIRED]),
                np.deg2rad(table[:, ACTUAL]),
                table[:, [POSITIVE, NEGATIVE]],
            )
        )
    return sorted(found, key=lambda recording: recording.bend)


def without_repeats(table: Array) -> Array:
    """Rows of a recording without repetitions, since the file's clock is faster."""
    return np.asarray(table[np.diff(table[:, PHASE], prepend=-1.0) != 0.0])


def left_of_the_rest(
    recordings: Sequence[RealRecording], predicted: Callable[[HysteresisRecording, Array], Array]
) -> dict[int, tuple[float, float]]:
    """RMSE in rad on 1.3 cycles, which were fitted, and on the rest of two, by the tube's bend.

    `predicted` fits a model to a recording and returns its actual angle (N,) for a driving angle,
    in rad.
    """
    # The first cycle starts at rest and lacks the rise from the far end; 1.3 cycles include it.
    found = {}
    for recording in recordings:
        first = recording.within(0.0, FITTED_CYCLES * CYCLE_S)
        rest = recording.within(FITTED_CYCLES * CYCLE_S, 2.0 * CYCLE_S)
        seen = HysteresisRecording(recording.desired[first], recording.actual[first])
        error = predicted(seen, recording.desired) - recording.actual
        fitted, judged = (float(np.sqrt(np.mean(error[part] ** 2))) for part in (first, rest))
        found[recording.bend] = fitted, judged
    return found


def hysteresis_model(model: str, seed: int) -> Callable[[HysteresisRecording, Array], Array]:
    """A model of the papers, for `left_of_the_rest`."""
    return lambda recording, driver: fit_model([recording], seed, model).predict(driver)


def tension_loop_width(
    desired: ArrayLike, tension_positive: ArrayLike, tension_negative: ArrayLike
) -> float:
    """Width, in the unit of the angle (N,), of the loop of both wires' tension difference in N."""
    # The difference of the tensions is the load of the joint's drive, and leads the desired angle,
    # since at a reversal friction changes its sign at the motor first. On real recordings its width
    # falls linearly with the backlash size; on the simulated rig it falls from a capstan exponent
    # of 0.7 on, and hardly changes below.
    difference = np.asarray(tension_negative, dtype=float) - np.asarray(tension_positive)
    return width_at_mid_height(desired, difference)


def leave_one_out_errors(feature: ArrayLike, target: ArrayLike) -> NDArray[np.float64]:
    """Errors (R,) of a straight line through all other points, at each of R >= 3 points."""
    x, y = np.asarray(feature, dtype=float), np.asarray(target, dtype=float)
    errors = np.empty_like(y)
    for k in range(len(y)):
        others = np.arange(len(y)) != k
        slope, intercept = np.polyfit(x[others], y[others], 1)
        errors[k] = slope * x[k] + intercept - y[k]
    return errors
