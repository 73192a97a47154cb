"""Physics that the catalogue does not have: a sparse law, regressed through the simulator.

A candidate term is pushed into the simulator at its node, and what the sensors would then read is
what competes for the residual: the regression never differentiates a measurement, and a term at
the wrong node answers on the wrong channels. Chosen terms are put back and refitted there, their
states taken from the simulation that they take part in (sparse regression after Brunton, Proctor,
Kutz, PNAS 113, 2016; orthogonal matching pursuit after Pati et al., Asilomar 1993).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.layout import (
    IN_PUSH_COMMAND,
    IN_PUSH_MOMENT,
    IN_PUSH_STRETCH,
    OUT_BENDING,
)
from endoscope_explain.explanation import Estimate, UnknownTerm
from endoscope_explain.fit.model import Fit
from endoscope_explain.fit.simulated_joint import residuals, simulate_joint
from endoscope_explain.joint_states import STATE_NAMES, JointStates, joint_states
from endoscope_explain.latent_library import NODES, Term, library
from endoscope_explain.parallel import parallel_map

Array = NDArray[np.float64]

COLUMNS = {'command': IN_PUSH_COMMAND, 'stretch': IN_PUSH_STRETCH, 'moment': IN_PUSH_MOMENT}
PROBE = {'command': 0.005, 'stretch': 2e-5, 'moment': 2e-4, 'reading': 0.005}
"""Rms of a term when it is tried: well above the integrator's error, small for the physics."""
LARGEST_LAW = 3
WORTH_ADDING = 0.06
"""Share of the remaining misfit that a further term must remove."""
REFIT_STEPS = 6


@dataclass(frozen=True)
class Law:
    """Terms at one node with coefficients, and the joint's other free numbers.

    Attributes
    ----------
    terms : tuple of Term
    coefficients : array (K,)
    theta : array (n,)
    residuals : array (size,)
    push : array (N,)
        Along the simulation.
    curvature : array (K,)
        Of the cost by each coefficient, the others free.
    """

    terms: tuple[Term, ...]
    coefficients: Array
    theta: Array
    residuals: Array
    push: Array
    curvature: Array


def unknown_term(fit: Fit, jobs: int, siblings: tuple[str, ...]) -> UnknownTerm | None:
    """Find the missing term of a joint that no effect of the catalogue explains.

    Parameters
    ----------
    fit : Fit
        The best that the catalogue can do.
    jobs : int
    siblings : tuple of str
        Nearest effects of the catalogue.

    Returns
    -------
    UnknownTerm or None
        None where no term of the library explains anything.
    """
    law = refit(fit, pursue(fit, jobs))
    if law is None:
        return None
    node = law.terms[0].node
    before, after = float(np.sum(fit.residuals**2)), float(np.sum(law.residuals**2))
    above = before - fit.model.observation.size
    used = sorted({name for name in STATE_NAMES for t in law.terms if name in _names(t)})
    spread = (
        1.645
        / np.sqrt(np.maximum(law.curvature, 1e-300))
        * np.sqrt(max(after / fit.model.observation.size, 1.0))
    )
    return UnknownTerm(
        fit.model.observation.joint,
        node,
        NODES[node],
        ' + '.join(
            f'{c:.4g}*{t.expression}' for c, t in zip(law.coefficients, law.terms, strict=True)
        ).replace('+ -', '- '),
        {name: STATE_NAMES[name] for name in used},
        tuple(
            Estimate(float(c), float(c - s), float(c + s), NODES[node])
            for c, s in zip(law.coefficients, spread, strict=True)
        ),
        float(np.clip((before - after) / max(above, 1.0), 0.0, 1.0)),
        np.asarray(1e-3 * np.arange(len(law.push)), dtype=float),
        law.push,
        law.push,
        siblings,
    )


def pursue(fit: Fit, jobs: int) -> tuple[Term, ...]:
    """Choose terms at one node by orthogonal matching pursuit on their answers."""
    parameters, lead = fit.model.packed(fit.theta)
    observation = fit.model.observation
    outputs = simulate_joint(observation, parameters, fit.model.flags)
    states = joint_states(observation, parameters, outputs)
    terms = library(states)

    def answer(index: int) -> Array:
        return _answer(fit, parameters, lead, outputs, terms[index], states).astype(np.float32)

    span, _ = np.linalg.qr(fit.jacobian)
    answers = [a.astype(float) for a in parallel_map(answer, range(len(terms)), jobs)]
    answers = [a - span @ (span.T @ a) for a in answers]
    left = fit.residuals - span @ (span.T @ fit.residuals)
    chosen: list[int] = []
    while len(chosen) < LARGEST_LAW:
        gains = np.array(
            [
                _gain(a, left)
                if i not in chosen and (not chosen or terms[i].node == terms[chosen[0]].node)
                else 0.0
                for i, a in enumerate(answers)
            ]
        )
        best = int(np.argmax(gains))
        if gains[best] < WORTH_ADDING * float(left @ left):
            break
        chosen.append(best)
        direction = answers[best] / np.linalg.norm(answers[best])
        left = left - direction * float(direction @ left)
        answers = [a - direction * float(direction @ a) for a in answers]
    return tuple(terms[i] for i in chosen)


def refit(fit: Fit, terms: tuple[Term, ...]) -> Law | None:
    """Put a law back into the simulator and refit it there with the joint's own numbers."""
    if not terms:
        return None
    observation = fit.model.observation
    theta, c = fit.theta.copy(), np.zeros(len(terms))
    low, high = fit.model.bounds()
    parameters, lead = fit.model.packed(theta)
    outputs = simulate_joint(observation, parameters, fit.model.flags)
    current, damping = fit.residuals, 1e-3
    states = joint_states(observation, parameters, outputs)
    answers = np.empty((len(current), 0))
    curvature = np.ones(len(terms))
    for _ in range(REFIT_STEPS):
        parameters, lead = fit.model.packed(theta)
        answers = np.stack(
            [_answer(fit, parameters, lead, outputs, t, states, (terms, c)) for t in terms], axis=1
        )
        full = np.hstack([fit.jacobian, answers])
        weight = np.concatenate([fit.model.prior_weight(), np.zeros(len(terms))])
        normal = full.T @ full + np.diag(weight**2)
        gradient = full.T @ current
        gradient[: len(theta)] += fit.model.prior_weight() * fit.model.prior(theta)
        curvature = 1.0 / np.diag(np.linalg.pinv(normal))[len(theta) :]
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), -gradient)
        new_theta = np.clip(theta + step[: len(theta)], low, high)
        new_c = c + step[len(theta) :]
        new_parameters, new_lead = fit.model.packed(new_theta)
        new_outputs = _simulate(fit, new_parameters, terms, new_c, states)
        new_states = joint_states(observation, new_parameters, new_outputs)
        trial = residuals(observation, new_outputs, new_lead)
        if float(trial @ trial) < float(current @ current):
            theta, c, outputs, states, current = new_theta, new_c, new_outputs, new_states, trial
            damping = max(damping / 10.0, 1e-6)
        else:
            damping *= 10.0
    if not np.any(c):
        return None
    return Law(terms, c, theta, current, _push(terms, c, states), curvature)


def _push(terms: tuple[Term, ...], coefficients: Array, states: JointStates) -> Array:
    total = np.zeros(len(states['t']))
    for term, coefficient in zip(terms, coefficients, strict=True):
        total = total + coefficient * term.along(states)
    return total


def _simulate(
    fit: Fit, parameters: Array, terms: tuple[Term, ...], coefficients: Array, states: JointStates
) -> Array:
    observation, node = fit.model.observation, terms[0].node
    push = _push(terms, coefficients, states)
    if node == 'reading':
        outputs = simulate_joint(observation, parameters, fit.model.flags)
        outputs[:, OUT_BENDING] += push
        return outputs
    inputs = observation.inputs.copy()
    inputs[0, :, COLUMNS[node]] += push
    return simulate_joint(observation, parameters, fit.model.flags, inputs)


def _answer(
    fit: Fit,
    parameters: Array,
    lead: float,
    outputs: Array,
    term: Term,
    states: JointStates,
    law: tuple[tuple[Term, ...], Array] | None = None,
) -> Array:
    """Change of the residual (size,) for one unit of a term's coefficient."""
    size = float(np.sqrt(np.mean(term.along(states) ** 2)))
    if size < 1e-12:
        return np.zeros(fit.model.observation.size)
    probe = PROBE[term.node] / size
    terms, coefficients = law if law is not None else ((), np.empty(0))
    moved = _simulate(
        fit, parameters, (term, *terms), np.concatenate([[probe], coefficients]), states
    )
    observation = fit.model.observation
    return (residuals(observation, moved, lead) - residuals(observation, outputs, lead)) / probe


def _gain(answer: Array, left: Array) -> float:
    size = float(answer @ answer)
    return float(answer @ left) ** 2 / size if size > 1e-12 else 0.0


def _names(term: Term) -> set[str]:
    return set(compile(term.expression, '<term>', 'eval').co_names)
