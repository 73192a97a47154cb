"""A universal differential equation: a small network within the simulator, in place by place.

Rackauckas et al., arXiv:2001.04385, 2020. The plant's own numbers are refitted with it, linearly.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from endoscope_benchmarks.concealed.judge import Statement
from endoscope_benchmarks.peers.problem import OwnExample, Problem, is_held_out, predicts
from endoscope_core.physics.functions.places import NODES, VALUES
from endoscope_explain.search.screen import Background, background, directions
from endoscope_explain.search.term import Term, functions

Array = NDArray[np.float64]

UNITS = 3
"""Of the network's one hidden layer."""
EVALUATIONS = 4
"""Of the network's derivative, at most."""


def by_network(problem: Problem) -> Statement | None:
    """The place at which a network leaves least of held-out blocks."""
    behind = background(problem.refitted)
    before = behind.left(problem.refitted.residuals * behind.weight)
    terms = functions(problem.refitted, before)
    scaled = [each.term for each in directions(behind, terms, 1)]
    observation = problem.refitted.model.observation
    time = np.concatenate([channel.time for channel in observation.channels])
    held = is_held_out(time)
    trained = {place.id: _trained(behind, place, before, ~held) for place in scaled}
    best = min(trained, key=lambda name: float(np.sum(trained[name][held] ** 2)))
    if not predicts(time[held], before[held] ** 2, trained[best][held] ** 2):
        return None
    return problem.says(best)


def network_example() -> OwnExample:
    """The paper's first: what Lotka and Volterra's equations say of two species that meet."""
    true = np.array([-0.9, 0.8])
    seen = _species(lambda x: true * x[0] * x[1])
    draw = np.random.default_rng(1)
    noisy = seen + 5e-3 * seen.mean(axis=0) * draw.standard_normal(seen.shape)

    def network(weights: Array) -> Callable[[Array], Array]:
        inner, offset, outer = (
            weights[:10].reshape(5, 2),
            weights[10:15],
            weights[15:].reshape(2, 5),
        )
        return lambda x: np.asarray(outer @ np.tanh(inner @ x / 3.0 + offset))

    begin = draw.standard_normal(25) * np.repeat([1.0, 0.1], [15, 10])
    found = least_squares(
        lambda w: np.clip(_species(network(w)) - noisy, -1e3, 1e3).ravel(), begin, max_nfev=100
    )
    learnt = np.array([network(found.x)(x) for x in seen])
    meant = true * np.prod(seen, axis=1, keepdims=True)
    error = float(np.linalg.norm(learnt - meant) / np.linalg.norm(meant))
    return OwnExample('Lotka-Volterra', 'the missing terms to 10 %', f'{error:.1%}', error < 0.1)


def _species(meet: Callable[[Array], Array]) -> Array:
    """Two species (61, 2) over three units of time, by Runge and Kutta's method."""

    def slope(x: Array) -> Array:
        return np.array([1.3, -1.8]) * x + meet(x)

    path, h = [np.array([0.44249296, 4.6280594])], 0.05
    with np.errstate(all='ignore'):
        for _ in range(60):
            x = path[-1]
            a = slope(x)
            b = slope(x + 0.5 * h * a)
            c = slope(x + 0.5 * h * b)
            path.append(x + h / 6.0 * (a + 2.0 * b + 2.0 * c + slope(x + h * c)))
    return np.nan_to_num(np.array(path), nan=1e3, posinf=1e3, neginf=-1e3)


def _trained(behind: Background, place: Term, before: Array, seen: NDArray[np.bool_]) -> Array:
    """Weighted residuals (size,) with a network trained on the samples that are seen."""
    family = place.family
    assert family is not None
    model = place.added_to(behind.coarse)
    parameters, lead = model.packed(model.begun_at(behind.fit.theta))
    first, at = family.place.first_parameter + VALUES, np.linspace(-1.0, 1.0, NODES)
    size = float(np.sqrt(np.mean(family.basis**2)))

    def left(weights: Array) -> Array:
        slope, offset, height = weights.reshape(3, UNITS)
        values = size * (height @ np.tanh(slope[:, None] * at + offset[:, None]))
        changed = parameters.copy()
        changed[first : first + NODES] = family.within(values)
        moved = model.residuals_of(changed, lead) - behind.at
        return before + behind.left((moved * behind.weight)[:, None])[:, 0]

    start = np.concatenate(
        [np.linspace(1.0, 3.0, UNITS), np.linspace(-1.0, 1.0, UNITS), [0.01] * 3]
    )
    found = least_squares(lambda w: left(w)[seen], start, max_nfev=EVALUATIONS, diff_step=1e-3)
    return left(found.x)
