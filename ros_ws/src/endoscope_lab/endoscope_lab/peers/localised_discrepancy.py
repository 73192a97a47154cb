"""LISDD: first where a model is wrong, then which term is missing there, then whether it is real.

Wang, arXiv:2606.23215, 2026, by its abstract; the page on peers says which parts are ours.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher
from scipy.stats import false_discovery_control, norm

from endoscope_explain.locate.excess import WINDOW_S
from endoscope_lab.peers.library import Term, terms_of
from endoscope_lab.peers.problem import LEVEL, OwnExample, Problem, Reply, on_grid

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Library = Mapping[str, Sequence[Term]]
"""Terms by name: all that may stand for one missing mechanism."""

CLEAN = 0.5
"""Share of the windows that are the clean regime: the fewest that least trimmed squares need."""
ROUNDS = 20
PARTS = 3
"""The flagged windows go to them in turn: one to fit on, one to choose by, one to test on."""
LEAST = 2 * PARTS
"""Flagged windows with fewer than which a part has nothing to compare."""


def by_lisdd(problem: Problem) -> Reply:
    """What is missing in the flagged windows, and when they are."""
    fit = problem.refitted
    observation = fit.model.observation
    slopes = np.stack([on_grid(observation, s, problem.time) for s in fit.jacobian.T], axis=2)
    window = (problem.time // WINDOW_S).astype(int)
    prior = np.diag(fit.model.prior_weight())
    residuals, flagged = localised(problem.residuals, slopes, prior, window)
    library: dict[str, list[Term]] = {}
    for term in terms_of(problem):
        library.setdefault(term.name, []).append(term)
    name = missing_term(residuals, library, window, flagged)
    times = tuple((float(w * WINDOW_S), float((w + 1) * WINDOW_S)) for w in np.flatnonzero(flagged))
    return Reply(None if name is None else problem.says(name), times)


def localised(
    residuals: Array, slopes: Array, prior: Array, window: NDArray[np.int_]
) -> tuple[Array, Mask]:
    """Residuals (M, S) over noise of a refit to the clean regime, and which windows stand out."""
    # `slopes` (M, S, n) are of the model's predictions, `prior` (n, n) weighs its numbers' steps,
    # `window` (M,) says to which each sample belongs.
    # Least trimmed squares by concentration steps (Rousseeuw, Van Driessen, Data Min. Knowl.
    # Discov. 12, 2006), on windows.
    count = np.maximum(np.bincount(window), 1)
    clean = np.ones(len(count), bool)
    left, noise, energy = residuals, np.ones(residuals.shape[1]), np.zeros(len(count))
    for _ in range(ROUNDS):
        squares = np.stack([np.bincount(window, r**2) for r in left.T], axis=1) / count[:, None]
        noise = np.sqrt(np.median(squares, axis=0)) + 1e-12
        energy = np.mean(squares / noise**2, axis=1)
        calmest = energy <= np.quantile(energy, CLEAN)
        if np.array_equal(calmest, clean):
            break
        clean = calmest
        seen = clean[window]
        design = (slopes[seen] / noise[:, None]).reshape(-1, slopes.shape[2])
        target = (residuals[seen] / noise).ravel()
        step = np.linalg.solve(design.T @ design + prior.T @ prior, design.T @ target)
        left = residuals - slopes @ step
    # The cube root of a sum of squares is nearly normal (Wilson, Hilferty, PNAS 17, 1931); the calm
    # half says of what spread, so that neighbours in time need not be independent.
    root = np.cbrt(energy)
    low, middle = np.quantile(root, [0.5 * CLEAN, CLEAN])
    spread = (middle - low) / norm.ppf(0.75)
    return left / noise, false_discovery_control(norm.sf((root - middle) / spread)) <= LEVEL


def missing_term(
    residuals: Array, library: Library, window: NDArray[np.int_], flagged: Mask
) -> str | None:
    """Name of the terms that leave least of the held-out flagged windows, if they are real."""
    if np.sum(flagged) < LEAST:
        return None
    turn = np.full(len(flagged), -1)
    turn[flagged] = np.arange(np.sum(flagged)) % PARTS
    fitted, chosen, tested = (turn[window] == part for part in range(PARTS))

    def left(terms: Sequence[Term], learn: Mask, judge: Mask) -> float:
        total = 0.0
        for signal, target in enumerate(residuals.T):
            design = np.stack([t.values * (signal in t.signals) for t in terms], axis=1)
            weights = np.linalg.lstsq(design[learn], target[learn], rcond=None)[0]
            total += float(np.sum((target[judge] - design[judge] @ weights) ** 2))
        return total

    best = min(library, key=lambda name: left(library[name], fitted, chosen))
    # Samples of a window follow each other too closely to be several.
    free = sum(len(term.signals) for term in library[best])
    samples = int(np.sum(turn == PARTS - 1)) * residuals.shape[1]
    if samples <= free:
        return None
    after = left(library[best], tested, tested)
    ratio = (float(np.sum(residuals[tested] ** 2)) - after) / free / after * (samples - free)
    return best if fisher.sf(ratio, free, samples - free) <= LEVEL else None


def lisdd_example() -> OwnExample:
    """A law of our own, after the paper's figures: 2 a - b, and sin(3 b) beyond a = 0.6."""
    draw = np.random.default_rng(1)
    a = np.sort(draw.uniform(-1.0, 1.0, 2000))
    b = draw.uniform(-1.0, 1.0, 2000)
    beyond = a > 0.6
    seen = 2.0 * a - b + np.where(beyond, np.sin(3.0 * b), 0.0) + 0.1 * draw.standard_normal(2000)
    known = np.stack([a, b], axis=1)
    ordinary = np.linalg.lstsq(known, seen, rcond=None)[0]
    window = np.arange(2000) // 50
    left, flagged = localised(
        (seen - known @ ordinary)[:, None], known[:, None, :], np.zeros((2, 2)), window
    )
    forms = {
        'a': a, 'b': b, 'a^2': a**2, 'a b': a * b, 'b^2': b**2, 'b^3': b**3, 'exp(b)': np.exp(b),
        'sin(3 b)': np.sin(3.0 * b),
    }  # fmt: skip
    library = {name: [Term(name, (0,), values)] for name, values in forms.items()}
    name = missing_term(left, library, window, flagged)
    hits = int(np.sum(flagged[window] & beyond))
    f1 = 2.0 * hits / (int(np.sum(flagged[window])) + int(np.sum(beyond)))
    works = name == 'sin(3 b)' and f1 >= 0.8
    return OwnExample('sin(3 b) where a > 0.6', 'it, F1 0.80', f'{name}, F1 {f1:.2f}', works)
