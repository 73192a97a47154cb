"""A family of tubes fitted to recordings of one instrument in several of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from endoscope_core.errors import FileError, InputError
from endoscope_core.metrics import width_at_mid_height
from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.family import SIGNED, ReadingErrors, TubeFamily
from endoscope_core.physics.simulator import simulate
from endoscope_core.rig import shipped_rig

Array = NDArray[np.float64]

LUMPED = (0.0, 5.0, 0.0, 3.0)
"""Friction profile with all friction at the wire's ends: the lumped capstan plant."""

PRIORS: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    'capstan_exponent': ((0.95, 0.35), (0.4, 0.3)),
    'wire_stiffness': ((3000.0, -0.15), (0.3, 0.2)),
    'joint_stiffness': ((0.0045, 0.1), (0.4, 0.2)),
    'joint_friction': ((9e-4, 0.1), (0.5, 0.2)),
    'joint_presliding': ((0.03, 0.0), (0.5, 0.1)),
    'joint_rest_angle': ((0.0, 0.0, 0.0), (0.1, 0.1, 0.1)),
    'joint_presliding_spread': ((0.6,), (0.5,)),
    'section_friction': ((0.4,), (0.5,)),
    'section_straight_angle': ((0.0,), (0.2,)),
    'joint_radius': ((0.0008,), (0.3,)),
    'pulley_radius': ((0.0024,), (0.1,)),
    'pretension': ((4.7,), (0.1,)),
    'pretension_profile': ((0.7,), (0.07,)),
    'motor_bandwidth': ((30.0,), (0.03,)),
    'friction_profile': ((0.0, 0.0, 0.0), (0.5, 0.5, 0.3)),
    'load_cell_offset': ((0.0, 0.0), (0.5, 0.5)),
    'load_cell_delay': ((0.07,), (0.03,)),
    'tracker_delay': ((0.0125,), (0.003,)),
}
"""Fitted parameters: start of the search, in the numbers of a family, and prior tolerance (for
positive keys, of the logarithm). Servo and delays have what is known of the recordings: filter and
period of the load cells take 46 ms and, on average, 25 ms, besides an unknown delay; the tracker
holds for 25 ms."""
FITTED_CYCLES = 1.3
"""More than one cycle, since a cycle from rest lacks the rise from the other side, which
distinguishes friction that grows with the bend from its imitations."""
ANGLE_SCALE = math.radians(1.0)
TENSION_SCALE = 0.27
LEAST_SCALE, MOST_SCALE = 0.06, 0.18
"""Scales of the errors of angle, tension and its extremes: residuals of a plant without effects."""
_WORTH = 60.0
"""Independent readings in a cycle: the residual is smooth over a tenth of a second."""
_SCORED_EVERY = 2
_REACH = 4.0
_STEP = 0.03
_OFF = 0.15
_LINES = tuple(PRIORS)[:14]
_SIGNED = (*SIGNED, 'friction_profile', 'load_cell_offset', 'load_cell_delay', 'tracker_delay')
_JOINT = 'bend_x'
CYCLE_S = 2.0 * np.pi
"""Seconds of one cycle, and its phase: the motion is a sine of 1 rad/s."""
ROW_S = 5.0e-3
"""Seconds between rows. The phase column counts loops and is no clock."""
PHASE, DESIRED, ACTUAL, POSITIVE, NEGATIVE = 0, 1, 3, 4, 5
"""Columns: phase in rad, desired and actual angle in deg, tension of both wires in N."""


@dataclass(frozen=True)
class TubeRecording:
    """One tube of a rig, moved from rest, sampled evenly: N samples."""

    bend: float  # of the tube, rad
    tick: float  # between samples, s
    desired: Array  # commanded bending angle (N,), rad
    angle: Array  # measured bending angle (N,), rad, zero at the start
    tension: Array  # load cells of the positive and the negative wire (N, 2), N
    # Samples at which the first cycle, the second and so on begin, and at which the last ends.
    cycles: tuple[int, ...]

    def cycle(self, number: int) -> slice:
        """Samples of a cycle, the first being 1."""
        return slice(*self.cycles[number - 1 : number + 1])

    @property
    def fitted(self) -> slice:
        """Samples for the fit of a family: both branches of the loop."""
        return slice(0, round(FITTED_CYCLES * self.cycles[1]))

    @property
    def judged(self) -> slice:
        """Samples after the fitted ones, to the end of the last cycle."""
        return slice(self.fitted.stop, self.cycles[-1])

    def until(self, sample: int) -> TubeRecording:
        """The recording before a sample."""
        ends = tuple(end for end in self.cycles if end <= sample)
        return TubeRecording(
            self.bend,
            self.tick,
            self.desired[:sample],
            self.angle[:sample],
            self.tension[:sample],
            ends,
        )


@dataclass(frozen=True)
class TubeFigures:
    """Figures of a loop, in rad and N; extremes of tension (2,) are those of the two wires."""

    loop_width: float
    rmse: float
    least_angle: float
    most_angle: float
    least_tension: Array
    most_tension: Array


def figures(desired: Array, angle: Array, tension: Array) -> TubeFigures:
    """Figures of one or more settled cycles."""
    return TubeFigures(
        float(width_at_mid_height(desired, angle)),
        float(np.sqrt(np.mean((desired - angle) ** 2))),
        float(angle.min()),
        float(angle.max()),
        tension.min(axis=0),
        tension.max(axis=0),
    )


@dataclass(frozen=True)
class Misfit:
    """Rms residuals: angle in rad, tensions (2,) in N."""

    angle: float
    tension: Array


def read(family: TubeFamily, bend: float, desired: Array, tick: float) -> tuple[Array, Array]:
    """Angle (N,) in rad and tensions (N, 2) in N that the recorded rig would have read.

    `bend` is the tube's in rad, `desired` (N,) the commanded bending angle in rad, `tick` in s. The
    angle is relative to that at the start.
    """
    plant = PlantDescription(joints={_JOINT: family.joint(bend)})
    made = simulate(plant, (shipped_rig().joints.gear * desired)[:, None], tick)
    tip, readings = made.bending_true[:, 0], family.readings
    angle = np.interp(made.time - readings.tracker_delay, made.time, tip - tip[0])
    late = made.time - readings.load_cell_delay
    wires = [
        np.interp(late, made.time, made.tension[:, 0, k]) + offset
        for k, offset in enumerate(readings.load_cell_offset)
    ]
    return angle, np.stack(wires, axis=1)


def misfit(family: TubeFamily, recording: TubeRecording, part: slice) -> Misfit:
    """Residuals of a family on some samples of a recording."""
    angle, tension = read(family, recording.bend, recording.desired, recording.tick)
    return Misfit(
        float(np.sqrt(np.mean((angle - recording.angle)[part] ** 2))),
        np.sqrt(np.mean((tension - recording.tension)[part] ** 2, axis=0)),
    )


def fit_family(
    recordings: Sequence[TubeRecording],
    priors: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]] = PRIORS,
    friction_profile: tuple[float, ...] | None = None,
    starts: int = 3,
    seed: int = 0,
) -> TubeFamily:
    """Fit a family to all samples of all recordings at once.

    Bounded trust-region least squares (Branch, Coleman and Li 1999), with a Gaussian prior on every
    number: in similar tubes the stiffness of a wire is confounded with that of its joint, and a
    line through five tubes should hold for the tubes between. Finite differences span a few
    hundredths of a prior, since the plant has a kink where a wire becomes slack; for the same
    reason the search restarts, `starts` times in all, near the best point so far. Keys without a
    prior are nominal; a given friction profile is held instead of fitted.
    """
    _check(recordings)
    free = {k: v for k, v in priors.items() if friction_profile is None or k != 'friction_profile'}
    begin = np.concatenate([_unknowns(key, line) for key, (line, _) in free.items()])
    spread = np.concatenate([np.array(widths, dtype=float) for _, widths in free.values()])
    high = np.full(len(begin), _REACH)
    # A load cell reads at least its offset, which the least tension therefore bounds.
    if 'load_cell_offset' in free:
        least = np.min([recording.tension.min(axis=0) for recording in recordings], axis=0)
        at = _places(free)['load_cell_offset']
        high[at] = np.minimum(_REACH, (least - begin[at]) / spread[at])
    low = np.minimum(-_REACH, high - 1.0)

    def family(y: Array) -> TubeFamily:
        return _family(begin + spread * y, free, friction_profile or ())

    def residuals(y: Array) -> Array:
        made = family(y)
        return np.concatenate([*(_residuals(made, recording) for recording in recordings), y])

    def slopes(y: Array) -> Array:
        columns = []
        for k in range(len(y)):
            ahead, behind = y.copy(), y.copy()
            ahead[k], behind[k] = min(y[k] + _STEP, high[k]), max(y[k] - _STEP, low[k])
            rise = residuals(ahead) - residuals(behind)
            columns.append(rise / (ahead[k] - behind[k]))
        return np.array(columns).T

    random = np.random.default_rng(seed)
    best, cost = np.clip(np.zeros(len(begin)), low + 1e-6, high - 1e-6), math.inf
    first = best
    for _ in range(starts):
        found = least_squares(
            residuals, first, slopes, bounds=(low, high), ftol=1e-4, xtol=1e-5, max_nfev=25
        )
        if found.cost < cost:
            best, cost = found.x, float(found.cost)
        first = best + _OFF * random.standard_normal(len(best))
        first = np.clip(first, low + 1e-6, high - 1e-6)
    return family(best)


def _residuals(family: TubeFamily, recording: TubeRecording) -> Array:
    scored = slice(None, None, _SCORED_EVERY)
    angle, tension = read(family, recording.bend, recording.desired, recording.tick)
    off = (angle - recording.angle)[scored]
    pulled = (tension - recording.tension)[scored]
    weight = math.sqrt(_WORTH / len(off))
    return np.concatenate(
        [
            weight * off / ANGLE_SCALE,
            weight * pulled.ravel() / TENSION_SCALE,
            (tension.min(axis=0) - recording.tension.min(axis=0)) / LEAST_SCALE,
            (tension.max(axis=0) - recording.tension.max(axis=0)) / MOST_SCALE,
        ]
    )


def _unknowns(key: str, line: tuple[float, ...]) -> Array:
    unknowns = np.array(line, dtype=float)
    if key not in _SIGNED:
        unknowns[0] = math.log(unknowns[0])
    return unknowns


def _places(free: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]]) -> dict[str, slice]:
    ends = np.cumsum([0, *(len(line) for line, _ in free.values())]).tolist()
    return {key: slice(*pair) for key, pair in zip(free, pairwise(ends), strict=True)}


def _family(
    x: Array,
    free: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]],
    friction_profile: tuple[float, ...],
) -> TubeFamily:
    values: dict[str, tuple[float, ...]] = {}
    for key, place in _places(free).items():
        first, *growth = x[place].tolist()
        values[key] = (first if key in _SIGNED else math.exp(first), *growth)
    offset = values.get('load_cell_offset', (0.0, 0.0))
    return TubeFamily(
        {key: values[key] for key in _LINES if key in values},
        values.get('friction_profile', friction_profile),
        ReadingErrors(
            (offset[0], offset[1]),
            values.get('load_cell_delay', (0.0,))[0],
            values.get('tracker_delay', (0.0,))[0],
        ),
    )


def _check(recordings: Sequence[TubeRecording]) -> None:
    if not recordings:
        raise InputError('no recordings: give those of at least one tube')
    for recording in recordings:
        name = f'tube bent by {math.degrees(recording.bend):.0f} deg'
        samples = len(recording.desired)
        if recording.angle.shape != (samples,) or recording.tension.shape != (samples, 2):
            raise InputError(f'{name}: angle or tension has another length than the command')
        if samples < 100:
            raise InputError(f'{name}: {samples} samples are too few')
        for values in (recording.desired, recording.angle, recording.tension):
            if not np.all(np.isfinite(values)):
                raise InputError(f'{name}: a value is not finite')


def tube_recordings(folder: Path) -> list[TubeRecording]:
    """Read two cycles in real time of each tube of a folder from `BEND.txt` (deg), by bend."""
    found = []
    for path in folder.glob('[0-9]*.txt'):
        table = np.loadtxt(path, delimiter=',')
        cycles = np.searchsorted(table[:, PHASE], (0.0, CYCLE_S, 2.0 * CYCLE_S)).tolist()
        if table[-1, PHASE] < 2.0 * CYCLE_S or cycles[0] != 0:
            raise FileError(f'{path}: fewer than two whole cycles')
        found.append(
            TubeRecording(
                float(np.deg2rad(float(path.stem))),
                ROW_S,
                np.deg2rad(table[:, DESIRED]),
                np.deg2rad(table[:, ACTUAL]),
                table[:, [POSITIVE, NEGATIVE]],
                tuple(cycles),
            )
        )
    if not found:
        raise FileError(f'{folder}: no recordings of tubes (files such as 60.txt)')
    return sorted(found, key=lambda recording: recording.bend)
