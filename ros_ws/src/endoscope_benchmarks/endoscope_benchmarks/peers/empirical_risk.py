"""emdcmp: which of our own candidate models would do worse in every repetition of the experiment.

Rene, Longtin, Nat. Commun. 2025 (empirical model discrepancy).
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import constants

from endoscope_benchmarks.concealed.judge import Statement
from endoscope_benchmarks.peers.problem import OwnExample, Problem
from endoscope_explain.search.refit import candidate, refit, trial_fit
from endoscope_explain.search.screen import background, directions, screened
from endoscope_explain.search.term import effects, functions

Array = NDArray[np.float64]
MODELS = 3
"""That promise most by a score test, beside the nominal plant; the method itself proposes none."""
SENSITIVITY = 0.25
"""c: between 1/4 and 1/2, say the authors."""
REJECTED = 0.95
SAMPLES = 4000


def by_empirical_risk(problem: Problem) -> Statement | None:
    """The model of least expected risk, with those that it does not reject as rivals."""
    behind = background(problem.refitted)
    left = behind.left(problem.refitted.residuals * behind.weight)
    terms = (*effects(problem.refitted, problem.left_out), *functions(problem.refitted, left))
    ways = directions(behind, terms, 1)
    ranked = {term.id: term for term in screened(behind, ways)[::-1]}
    nominal = candidate((), problem.refitted)
    fits = {'': problem.refitted}
    for name in list(ranked)[: -MODELS - 1 : -1]:
        seen = trial_fit((problem.refitted, problem.described), ranked[name], behind.offset)
        fits[name] = refit((seen,), nominal).fit
    draw = np.random.default_rng(1)
    chosen = draw.choice(len(problem.refitted.residuals), SAMPLES)
    ideal = 0.5 * draw.standard_normal((len(fits), SAMPLES)) ** 2
    losses = [0.5 * fit.residuals[chosen] ** 2 for fit in fits.values()]
    standing = not_rejected(dict(zip(fits, zip(losses, ideal, strict=True), strict=True)))
    if '' in standing:
        return None
    said = problem.says(standing[0])
    return Statement(said.name, said.joint, said.stage, tuple(standing[1:]))


def not_rejected(losses: Mapping[str, tuple[Array, Array]]) -> list[str]:
    """Models that no other one beats in 95 % of repetitions, that of least risk first."""
    # Losses are on what was measured, and on what the model generates itself.
    from emdcmp import emd

    # emdcmp draws from a generator that nobody can seed.
    risks = {}
    for name, pair in losses.items():
        measured, generated = (emd.make_empirical_risk_ppf(each) for each in pair)
        few = {'res': 6, 'M': 32, 'max_M': 64, 'relstderr_tol': 0.2, 'path_progbar': None}
        risks[name] = emd.draw_R_samples(measured, generated, SENSITIVITY, **few)

    def is_beaten(name: str) -> bool:
        return any(np.mean(other[:, None] < risks[name]) > REJECTED for other in risks.values())

    return sorted((n for n in risks if not is_beaten(n)), key=lambda n: float(np.mean(risks[n])))


def empirical_risk_example() -> OwnExample:
    """The paper's: Planck's law against Rayleigh and Jeans', which fails at short waves alone."""
    draw, noise, temperature = np.random.default_rng(1), 0.1, 4000.0

    def planck(wave: Array) -> Array:
        quantum = constants.h * constants.c / (wave * constants.k * temperature)
        return np.asarray(2.0 * constants.h * constants.c**2 / wave**5 / np.expm1(quantum))

    def classical(wave: Array) -> Array:
        return np.asarray(2.0 * constants.c * constants.k * temperature / wave**4)

    gave = []
    for low, high in ((15e-6, 30e-6), (400e-6, 1000e-6)):
        wave = np.linspace(low, high, SAMPLES)
        seen = planck(wave) * (1.0 + noise * draw.standard_normal(SAMPLES))
        ideal = 0.5 * draw.standard_normal(SAMPLES) ** 2
        losses = {
            law.__name__: (0.5 * ((seen / law(wave) - 1.0) / noise) ** 2, ideal)
            for law in (planck, classical)
        }
        gave.append(sorted(not_rejected(losses)))
    works = gave == [['planck'], ['classical', 'planck']]
    said = '; '.join(' and '.join(each) for each in gave)
    return OwnExample('law of radiation', 'Planck; at long waves both', said, works)
