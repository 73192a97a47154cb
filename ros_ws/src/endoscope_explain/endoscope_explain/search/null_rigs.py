"""How much rigs show in which nothing is missing: other forms, and sensors whose noise is slow.

Rigs are screened and fitted as the recording is that are off by as much, but for another reason:
their sheaths are of another form, or their sensors wander. What share of them shows as much is the
chance of a false alarm over the whole search (a parametric bootstrap of the largest gain: Efron,
Tibshirani, An Introduction to the Bootstrap, 1993, ch. 16).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from endoscope_core.workers import parallel_map
from endoscope_explain.fit.evidence import counts, is_noise, log_likelihood, mean_squares
from endoscope_explain.fit.intervals import other_forms, reading
from endoscope_explain.fit.model import Fit, broyden_fit, jacobian
from endoscope_explain.observe.observation import WHITE, JointObservation
from endoscope_explain.search.refit import TRIAL_STEPS
from endoscope_explain.search.screen import Background, Directions, gains
from endoscope_explain.search.term import Term

Array = NDArray[np.float64]

FORMS, WANDERING = 20, 19
"""Rigs of another form and rigs whose sensors wander: enough to say that 1 in 40 shows as much."""
FITTED = 3
"""Terms of the screen that are fitted: in the study the truth was among the first three in 46 cases
of 48."""
AT_ONCE = 13
"""Rigs that are fitted before it is asked whether more would change anything, of 39."""
NEAR = 0.5
"""Share of the best gain that the truth has at least: in the study in 46 cases of 48. Rigs in which
nothing is missing and that stay below it are clear."""
BY_SCREEN = 0.25
"""Share of a gain that all rigs stay below by the screen alone if it is clear without a fit: on
eight levels of six development cases fits raised the largest of a level by a factor of 1.7 at most,
and two is allowed for."""
SLOWEST = 0.1
"""Longest correlation time of noise, as a share of the recording: what is slower is a drift."""
_SEED = 11
_TINY = 1e-12


@dataclass(frozen=True)
class Null:
    """Gains of the best term on rigs in which nothing is missing."""

    # (B,), on rigs in which nothing is missing, off by as much as the recording is.
    drawn: Array = field(repr=False)
    # (B,), the same where they are off by as much as the best candidate leaves.
    doubt: Array = field(repr=False)

    def p_value(self, gain: float) -> float:
        """Chance that a rig in which nothing is missing shows as much."""
        return (1.0 + int(np.sum(self.drawn >= gain))) / (1.0 + len(self.drawn))


NO_DETECTABLE_GAIN = Null(np.zeros(1), np.zeros(1))
"""Where no term moves anything."""


@dataclass(frozen=True)
class Shown:
    """Gains of all terms by the screen, as in `Null`."""

    observed: Array  # (terms,)
    drawn: Array  # (terms, B)
    doubt: Array  # (terms, B)
    rigs: Array  # (size, B), what the drawn rigs are off by, in noise units


def shown(behind: Background, ways: tuple[Directions, ...], best: Fit, jobs: int) -> Shown:
    """Run the screen over the recording and over rigs in which nothing is missing."""
    found, observation = behind.fit, behind.fit.model.observation
    generator = np.random.default_rng(_SEED)
    own = behind.left(found.residuals * behind.weight)
    forms, _ = other_forms(found, FORMS, jobs)
    left = behind.left(forms * behind.weight[:, None])
    slow = wandering(observation, WANDERING, generator) * behind.weight[:, None]
    white = generator.normal(size=(observation.size, FORMS + WANDERING)) * behind.weight[:, None]
    white = behind.left(white)
    number = counts(observation)
    parts = observation.slices()
    floor = np.array([behind.weight[part][0] ** 2 for part in parts])

    def above_noise(residuals: Array) -> Array:
        return np.maximum(mean_squares(observation, residuals) - 1.0, 0.0)

    def like(off: Array) -> Array:
        """Wandering sensors, each by as much as its channel is off."""
        size = np.concatenate(
            [np.full(p.stop - p.start, np.sqrt(o)) for p, o in zip(parts, off, strict=True)]
        )
        return behind.left(slow * size[:, None])

    alone = gains(behind, ways, left)
    winner = np.argmax(alone.values, axis=0)
    rest = np.sum(alone.left[winner, np.arange(FORMS)] * number, axis=1)
    whole = np.sum(left**2, axis=0)
    off = above_noise(found.residuals)
    # Where noise alone is left, no form misleads.
    remains = np.zeros_like(off)
    if not is_noise(best):
        remains = above_noise(best.residuals)
    as_off = np.sqrt(np.sum(number * floor * off) / np.maximum(whole, _TINY))
    as_left = np.sqrt(np.sum(number * floor * remains) / np.maximum(rest, _TINY))

    drawn = np.hstack([as_off * left, like(off)]) + white
    doubt = np.hstack([np.minimum(as_left, as_off) * left, like(remains)]) + white
    return Shown(
        gains(behind, ways, own[:, None]).values[:, 0],
        gains(behind, ways, drawn).values,
        gains(behind, ways, doubt).values,
        drawn / behind.weight[:, None],
    )


@dataclass(frozen=True)
class NullRigs:
    """Rigs in which nothing is missing, screened; the most promising are fitted where asked."""

    behind: Background
    ways: tuple[Directions, ...]
    screened: Shown

    def of(self, term: str) -> 'NullRigs':
        """The same rigs, screened for one term alone."""
        rows = [k for k, way in enumerate(self.ways) if way.term.id == term]
        seen = self.screened
        seen = replace(
            seen, observed=seen.observed[rows], drawn=seen.drawn[rows], doubt=seen.doubt[rows]
        )
        return replace(self, ways=tuple(self.ways[k] for k in rows), screened=seen)

    def as_screened(self) -> Null:
        """What they show by the screen alone."""
        return Null(np.max(self.screened.drawn, axis=0), np.max(self.screened.doubt, axis=0))

    def beside(self, gain: float, level: float, jobs: int) -> Null:
        """What they show, by fits of the most promising rigs until it is clear beside a gain."""
        # It is where the screen shows far less, once more of them show as much than the `level` of
        # false alarms allows, or once the most promising ones stay far below (sequential Monte
        # Carlo tests: Besag, Clifford, Biometrika 78, 1991).
        null = self.as_screened()
        if np.max(null.drawn) < BY_SCREEN * gain:
            return null
        ranked = np.argsort(self.screened.drawn, axis=0)[::-1][:FITTED]
        slopes: dict[int, Array] = {}

        def fitted(rig: int) -> float:
            off = self.screened.rigs[:, rig]
            return max(
                _gain(self.behind, self.ways[i], slopes[int(i)], off) for i in ranked[:, rig]
            )

        order = np.argsort(-null.drawn)
        for first in range(0, len(order), AT_ONCE):
            rigs = order[first : first + AT_ONCE]
            wanted = [int(i) for i in np.unique(ranked[:, rigs]) if int(i) not in slopes]
            terms = [self.ways[i].term for i in wanted]
            found = parallel_map(lambda term: _slopes(self.behind, term), terms, jobs)
            slopes |= dict(zip(wanted, found, strict=True))
            drawn = null.drawn.copy()
            drawn[rigs] = parallel_map(fitted, [int(rig) for rig in rigs], jobs)
            null = replace(null, drawn=drawn)
            if null.p_value(gain) > level or np.max(drawn[rigs]) < NEAR * gain:
                break
        return null


def null_of_several(
    behind: Sequence[Background],
    ways: Sequence[tuple[Directions, ...]],
    best: Sequence[Fit],
    gain: float,
    jobs: int,
) -> Null:
    """What rigs show of several recordings together, beside the gain of the best term's fits."""
    # One term is tried for that serves all of them, and the best of each recording would gain more.
    # Every shape of the tube has a profile of its own, so that what is drawn for one says nothing
    # of another.
    generator = np.random.default_rng(_SEED)
    order = generator.permuted(np.tile(np.arange(FORMS + WANDERING), (len(behind), 1)), axis=1)
    by_recording = [
        _of_each_effect(*each, jobs) for each in zip(behind, ways, best, order, strict=True)
    ]
    everywhere = set.intersection(*(set(each) for each in by_recording))
    if not everywhere:
        return NO_DETECTABLE_GAIN
    sums = [np.sum([each[effect] for each in by_recording], axis=0) for effect in everywhere]
    observed, drawn, doubt = np.split(np.max(sums, axis=0), [1, 1 + FORMS + WANDERING])
    # A fit adds to what the screen says of a rig what it adds to it of the recordings.
    scale = gain / observed[0] if observed[0] > 0.0 else np.inf
    return Null(scale * drawn, scale * doubt)


def _of_each_effect(
    behind: Background,
    ways: tuple[Directions, ...],
    best: Fit,
    order: NDArray[np.int64],
    jobs: int,
) -> dict[str, Array]:
    """Gains of each effect by the screen: on the recording, drawn and doubted (1 + B + B,)."""
    if not ways:
        return {}
    seen = shown(behind, ways, best, jobs)
    rows = np.column_stack([seen.observed, seen.drawn[:, order], seen.doubt[:, order]])
    gained: dict[str, Array] = {}
    for way, row in zip(ways, rows, strict=True):
        gained[way.term.id] = np.maximum(gained.get(way.term.id, row), row)
    return gained


def null_rigs(
    behind: Background, ways: tuple[Directions, ...], best: Fit, jobs: int
) -> NullRigs | None:
    """Screen rigs in which nothing is missing; None where no term moves anything."""
    return NullRigs(behind, ways, shown(behind, ways, best, jobs)) if ways else None


def _slopes(behind: Background, term: Term) -> Array:
    """Derivative of the residuals by a term's own numbers where it begins."""
    model = term.added_to(behind.coarse)
    theta = model.begun_at(behind.fit.theta)
    return jacobian(model, theta, list(range(len(behind.fit.theta), len(theta))))


def _gain(behind: Background, way: Directions, slopes: Array, off: Array) -> float:
    """Gain of a term by a fit of few simulations to a rig that is off by `off` (size,)."""
    found, weight = behind.fit, behind.weight
    seen = reading(found.model.observation, found.residuals - off)
    model = way.term.added_to(replace(found.model, observation=seen))
    coarse = model.on_coarse_ticks(behind.offset)
    theta = model.begun_at(found.theta)
    known = np.hstack([found.jacobian, slopes])
    after = broyden_fit(coarse, theta, known, TRIAL_STEPS, weight)
    before = behind.left(off * weight) / weight
    number = counts(seen)
    gained = log_likelihood(mean_squares(seen, after.residuals), number)
    gained -= log_likelihood(mean_squares(seen, before), number)
    if way.term.is_function:
        own = model.coefficients(after.theta)[-1]
        _, volume = np.linalg.slogdet(way.columns.T @ way.columns + np.eye(len(own)))
        gained -= 0.5 * (float(own @ own) + float(volume))
    return float(gained)


def wandering(observation: JointObservation, count: int, generator: np.random.Generator) -> Array:
    """Draw slow noise (size, count) of unit variance for each sensor whose noise is random."""
    # It is an Ornstein-Uhlenbeck process whose correlation time lies anywhere between that of white
    # noise and `SLOWEST`, evenly in its logarithm.
    drawn = np.zeros((observation.size, count))
    for channel, part in zip(observation.channels, observation.slices(), strict=True):
        if channel.quantity not in WHITE:
            continue
        period = observation.duration / (part.stop - part.start)
        for b in range(count):
            lasts = period * (SLOWEST * observation.duration / period) ** generator.uniform()
            kept = np.exp(-period / lasts)
            white = generator.normal(size=part.stop - part.start)
            white[1:] *= np.sqrt(1.0 - kept**2)
            drawn[part, b] = lfilter([1.0], [1.0, -kept], white)
    return drawn
