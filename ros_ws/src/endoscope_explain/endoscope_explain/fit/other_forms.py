"""Rigs of another form than the fitted one: what a simulation of the wrong form leaves.

A fit's misfit is mostly an error of form, not noise: friction along a real sheath has a finer
profile than the few terms that are fitted, and a law has finer details than the function that was
found for it. Rigs are simulated at the fitted numbers with a profile drawn anew beyond those terms
and functions with details, and the model is fitted to each of them. What that leaves, and by how
much it moves the numbers, is what form alone does (a parametric bootstrap over forms: Efron,
Tibshirani, An Introduction to the Bootstrap, 1993, ch. 21).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.functions.interpolation import NODES, VALUES
from endoscope_core.physics.layout import FRICTION_PROFILE, PROFILE_TERMS
from endoscope_core.physics.plant_numbers import NUMBERS
from endoscope_explain.fit.evidence import counts, mean_squares, weights
from endoscope_explain.fit.free_parameters import FRICTION_PROFILE_NAMES
from endoscope_explain.fit.model import Fit, broyden_fit
from endoscope_explain.fit.whiteness import is_noise
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.parallel import parallel_map

Array = NDArray[np.float64]

STEPS = 8
"""Simulations in which the model is fitted to a rig of another form, whose numbers are its own."""
FORMS = 19
"""Rigs that say what another form leaves, and how far it moves numbers: 1 in 20 leaves more."""
_SEED = 7
_TINY = 1e-12


@dataclass(frozen=True)
class OtherForms:
    """What rigs of another form leave, without noise.

    `residuals` (size, B): in noise units, with the model fitted to each rig.
    `moved` (n, B): by how much the form moves the fit's coordinates.
    """

    residuals: Array
    moved: Array


def other_forms(found: Fit, count: int, jobs: int) -> OtherForms:
    """Simulate rigs of another form at a fit's numbers and fit its model to them.

    `count`: rigs B.
    """
    model = found.model.on_coarse_ticks()
    parameters, lead = model.packed(found.theta)
    # The fitted numbers are these rigs' own: there is nothing that would draw a fit elsewhere.
    free = tuple(
        replace(item, mean=float(t)) for item, t in zip(model.free, found.theta, strict=True)
    )
    weight = weights(model.observation, found.residuals)
    finer = slice(FRICTION_PROFILE + len(FRICTION_PROFILE_NAMES), FRICTION_PROFILE + PROFILE_TERMS)
    size = NUMBERS['friction_profile'].spread
    generator = np.random.default_rng(_SEED)

    def drawn() -> Array:
        rig = parameters.copy()
        rig[finer] += size * generator.normal(size=finer.stop - finer.start)
        for family in model.families:
            first = family.place.first_parameter + VALUES
            detailed = rig[first : first + NODES] + family.details(generator)
            rig[first : first + NODES] = family.within(detailed)
        return rig

    def fitted(rig: Array) -> tuple[Array, Array]:
        readings = reading(model.observation, model.residuals_of(rig, lead))
        seen = replace(model, observation=readings, free=free)
        near = broyden_fit(seen, found.theta, found.jacobian, STEPS, weight)
        return near.residuals, near.theta - found.theta

    results = parallel_map(fitted, [drawn() for _ in range(count)], jobs)
    return OtherForms(
        np.stack([residuals for residuals, _ in results], axis=1),
        np.stack([moved for _, moved in results], axis=1),
    )


def with_form(found: Fit, jobs: int) -> Fit:
    """A fit that knows what an error of form does to it.

    Returns: with `moved_by_form` and `beyond_form`.
    """
    if found.beyond_form is not None:
        return found
    if is_noise(found):
        return replace(found, beyond_form=0.0)
    forms = other_forms(found, FORMS, jobs)
    observation = found.model.observation
    left = np.maximum(mean_squares(observation, found.residuals) - 1.0, 0.0)
    drawn = np.stack([mean_squares(observation, r) for r in forms.residuals.T])
    beyond = float(np.max(np.sqrt((1.0 + left) / (1.0 + drawn.max(axis=0)))))
    # An error of form moves numbers the further the more of it there is.
    size = counts(observation) / (1.0 + left)
    scale = np.sum(size * left) / max(float(np.sum(size * drawn.mean(axis=0))), _TINY)
    moved = scale * forms.moved @ forms.moved.T / FORMS
    return replace(found, moved_by_form=moved, beyond_form=beyond)


def reading(observation: JointObservation, residuals: Array) -> JointObservation:
    """Sensors as they would read if they read more by residuals (size,) in noise units."""
    channels = tuple(
        replace(c, value=c.value + residuals[part] * c.noise)
        for c, part in zip(observation.channels, observation.slices(), strict=True)
    )
    return replace(observation, channels=channels)
