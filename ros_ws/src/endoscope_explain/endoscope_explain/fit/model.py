"""One joint simulated on its recorded commands, and fitted by output-error least squares."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import JointParameters, PlantDescription
from endoscope_core.physics.effect import NominalPhysics, Symptom
from endoscope_core.physics.effects import CATALOGUE, describe, showing
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.places import HIGH, LAG, NODES, VALUES
from endoscope_core.physics.layout import FRICTION_PROFILE, NOMINAL_KEYS, PROFILE_TERMS
from endoscope_core.physics.packing import pack
from endoscope_core.physics.simulator import TICK
from endoscope_explain.fit.family import Family
from endoscope_explain.fit.free_parameters import COEFFICIENT, COORDINATE, LEAD, FreeParameter
from endoscope_explain.fit.solver import STEP, Effort, Ended, Minimum, Renewal, Secants, minimise
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.observe.predicted_signals import simulate_joints
from endoscope_explain.recording import Array, Mask


def simulate_joint(
    observation: JointObservation,
    parameters: Array,
    flags: Mask,
    inputs: Array | None = None,
) -> Array:
    """Noise-free readings (N, OUTPUTS) of one joint under the recorded, or other, inputs."""
    return simulate_joints((observation,), parameters[None], flags[None], inputs)[0]


def residuals(
    observation: JointObservation, outputs: Array, lead: float = 0.0, skew: float = 0.0
) -> Array:
    """Simulated minus measured in noise units (size,); `lead` is in units of `TICK`."""
    lead *= TICK / observation.tick
    return np.concatenate(
        [
            (
                channel.predicted(outputs, lead, skew if channel.quantity == 'bending' else 0.0)
                - channel.value
            )
            / channel.noise
            for channel in observation.channels
        ]
    )


def packed_joint(plant: PlantDescription, joint: str) -> tuple[Array, Mask]:
    """Parameters (parameters,) and flags (flags,) of one joint of a plant."""
    parameters, flags = pack(plant)
    index = plant.joint_names().index(joint)
    return parameters[index], flags[index]


def joint_of(parameters: Array) -> JointParameters:
    """The nominal parameters of a joint packed as `parameters` (parameters,)."""
    numbers = dict(zip(NOMINAL_KEYS, parameters.tolist(), strict=False))
    profile = parameters[FRICTION_PROFILE : FRICTION_PROFILE + PROFILE_TERMS]
    terms = int(np.max(np.flatnonzero(profile), initial=-1)) + 1
    return JointParameters(**numbers, friction_profile=tuple(profile[:terms].tolist()))


CLOCK_RATE = showing(Symptom.CLOCK_RATE)
TO_THE_END = 20
"""Steps of a fit, at most, that is not to stop on its way."""
COARSE = 10
"""Ticks in one of the simulations that only show in which direction something goes."""
WIDE_STEP = 0.1
"""With sticking and slipping, the times of the slips jump with the parameters, and so do the
residuals: a wide difference looks over the jumps."""
_AT_BOUND = 1e-6
"""Share of its range within which a coordinate lies at an end of it: steps are cut there."""


@dataclass(frozen=True)
class JointModel:
    """One joint with some of its numbers free."""

    observation: JointObservation
    base: Array  # (parameters,), packed parameters; the free ones are replaced
    flags: Mask  # (flags,)
    free: tuple[FreeParameter, ...]
    # Difference step of a coordinate where an effect makes the misfit rugged.
    wide_step: float = WIDE_STEP
    # Of functions that are free; their coefficients are free parameters, in the same order.
    families: tuple[Family, ...] = ()
    coarse: int = COARSE  # ticks in one of the simulations from which derivatives are differences
    # (size,), added to the residuals: what coarse ticks do to them, as known somewhere near.
    offset: Array | None = field(default=None, repr=False)

    def on_coarse_ticks(self, offset: Array | None = None) -> 'JointModel':
        """The model for questions of direction and rank, which need no fine ticks."""
        observation = self.observation.coarser(self.coarse)
        return replace(self, observation=observation, coarse=1, offset=offset)

    def packed(self, theta: Array) -> tuple[Array, float]:
        """Packed parameters and reading lead at the coordinates `theta` (n,)."""
        parameters = self.base.copy()
        lead = 0.0
        for item, coordinate in zip(self.free, theta, strict=True):
            if item.index == LEAD:
                lead = item.value(float(coordinate))
            elif item.index != COEFFICIENT:
                parameters[item.index] = item.value(float(coordinate))
        for family, coefficients in zip(self.families, self.coefficients(theta), strict=True):
            first = family.place.first_parameter + VALUES
            parameters[first : first + NODES] = family.values(coefficients)
        return parameters, lead

    def coefficients(self, theta: Array) -> list[Array]:
        """Coefficients (K,) of each function at the coordinates `theta` (n,)."""
        return [COORDINATE * theta[places] for places in self.places_of_coefficients()]

    def places_of_coefficients(self) -> list[NDArray[np.int64]]:
        """Places (K,) of each function's coefficients among the free parameters."""
        found = [k for k, item in enumerate(self.free) if item.index == COEFFICIENT]
        ends = np.cumsum([family.basis.shape[1] for family in self.families])
        return np.split(np.array(found, dtype=np.int64), ends[:-1]) if self.families else []

    def family_at(self, which: int, theta: Array) -> Family:
        """Functions of a place, with the period or lag that they have at `theta` (n,)."""
        family = self.families[which]
        if family.band is None:
            return family
        parameters, _ = self.packed(theta)
        first = family.place.first_parameter
        if family.repeats:
            return replace(family, high=float(parameters[first + HIGH]))
        return replace(family, lag=float(parameters[first + LAG]))

    def begun_at(self, theta: Array) -> Array:
        """Coordinates `theta` of the first free parameters; the others as `base` has them."""
        others = [
            0.0 if item.index == COEFFICIENT else item.coordinate(float(self.base[item.index]))
            for item in self.free[len(theta) :]
        ]
        return np.concatenate([theta, others])

    def residuals(self, theta: Array) -> Array:
        """Residuals in noise units, all channels in a row."""
        return self.residuals_of(*self.packed(theta))

    def residuals_of(self, parameters: Array, lead: float) -> Array:
        """Residuals (size,) in noise units of packed parameters and a reading lead."""
        return self.read(self.outputs(parameters), parameters, lead)

    def outputs(self, parameters: Array) -> Array:
        """Simulated outputs (N, OUTPUTS) of packed parameters."""
        return simulate_joint(self.observation, parameters, self.flags)

    def read(self, outputs: Array, parameters: Array, lead: float) -> Array:
        """Residuals (size,) in noise units of simulated outputs, read with a lead."""
        skew = parameters[CLOCK_RATE.first_parameter] if self.flags[CLOCK_RATE.flag] else 0.0
        found = residuals(self.observation, outputs, lead, skew)
        return found if self.offset is None else found + self.offset

    @property
    def step(self) -> float:
        """Difference step of a logarithmic coordinate."""
        rugged = any(e.traits.rugged and self.flags[e.flag] for e in CATALOGUE.values())
        return self.wide_step if rugged else STEP

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates."""
        return (
            np.array([item.coordinate(item.low) for item in self.free]),
            np.array([item.coordinate(item.high) for item in self.free]),
        )

    def prior(self, theta: Array) -> Array:
        """Deviations from the priors' means in spreads."""
        return np.array(
            [
                0.0 if math.isinf(item.spread) else (coordinate - item.mean) / item.spread
                for item, coordinate in zip(self.free, theta, strict=True)
            ]
        )

    def prior_weight(self) -> Array:
        """Inverse spreads."""
        return np.array([1.0 / item.spread for item in self.free])

    def cost(self, residuals: Array, theta: Array) -> float:
        """Half squares of residuals at the coordinates `theta`, prior included."""
        return 0.5 * float(residuals @ residuals + np.sum(self.prior(theta) ** 2))


@dataclass(frozen=True)
class Fit:
    """A fitted joint."""

    model: JointModel
    theta: Array  # (n,), coordinates of the free parameters
    residuals: Array  # (size,), unweighted, in noise units
    jacobian: Array = field(repr=False)  # (size, n), of the residuals, at or near `theta`
    cost: float  # half weighted squares, prior included
    # (n, n), mean product of the ways by which an error of form as large as what is left moves two
    # coordinates.
    moved_by_form: Array | None = field(default=None, repr=False)
    # What is left of the worst channel over what the worst rig of another form leaves; 0 where
    # noise is left.
    beyond_form: float | None = None
    steps: int = 0  # of the solver, the last time that the joint was fitted
    ended: Ended | None = None  # why it went no further; None where nothing was fitted

    def at_bounds(self) -> tuple[str, ...]:
        """Names of the free parameters that were driven to an end of what is allowed."""
        low, high = self.model.bounds()
        near = _AT_BOUND * (high - low)
        at_end = (self.theta <= low + near) | (self.theta >= high - near)
        return tuple(
            item.name
            for item, there, coordinate in zip(self.model.free, at_end, self.theta, strict=True)
            # What is described to be at the end, such as no spread at all, was not driven there.
            if there and coordinate != item.mean
        )


def without_effect(found: Fit, effect_id: str) -> tuple[JointModel, Array]:
    """Model and first coordinates (n,) of a fit that has lost an effect, or a place's function."""
    model = found.model
    lost = FUNCTIONS.get(effect_id) or describe(effect_id)
    base, flags = model.base.copy(), model.flags.copy()
    flags[lost.flag] = False
    if isinstance(lost, NominalPhysics):
        base[lost.first_parameter] = lost.parameters[0].off
    gone = {k for k, item in enumerate(model.free) if item.index in lost.places}
    for family, places in zip(model.families, model.places_of_coefficients(), strict=True):
        gone |= {*places.tolist()} if family.place is lost else set()
    kept = [k for k in range(len(model.free)) if k not in gone]
    families = tuple(family for family in model.families if family.place is not lost)
    free = tuple(model.free[k] for k in kept)
    lesser = replace(model, base=base, flags=flags, free=free, families=families)
    return lesser, found.theta[kept]


def jacobian(model: JointModel, theta: Array, columns: list[int] | None = None) -> Array:
    """Difference quotients (size, columns) of the residuals at `theta` (n,), on coarser ticks."""
    # What is left of the error of coarse ticks in a difference turns a step by a few per cent; a
    # fit ends where the residuals on its own ticks do.
    low, high = model.bounds()
    columns = list(range(len(theta))) if columns is None else columns
    coarse = model.on_coarse_ticks()
    parameters, lead = coarse.packed(theta)
    outputs = coarse.outputs(parameters)
    at = coarse.read(outputs, parameters, lead)
    result = np.empty((len(at), len(columns)))
    for i, c in enumerate(columns):
        moved = theta.copy()
        step = model.step if model.free[c].logarithmic else 2.0 * model.step
        step = min(step, 0.5 * (high[c] - low[c]))
        step = step if theta[c] + step <= high[c] else -step
        moved[c] += step
        parameters, lead = coarse.packed(moved)
        # When a reading was taken is nothing that moves the rig.
        moves = model.free[c].index != LEAD
        seen = coarse.read(coarse.outputs(parameters) if moves else outputs, parameters, lead)
        result[:, i] = (seen - at) / (moved[c] - theta[c])
    return result


def central_jacobian(model: JointModel, theta: Array, step: float) -> Array:
    """Central difference quotients (size, n) of the residuals at `theta`, by `step` at least."""
    low, high = model.bounds()
    result = np.empty((model.observation.size, len(theta)))
    for k, item in enumerate(model.free):
        reach = max(step, model.step) * (1.0 if item.logarithmic else 2.0)
        below, above = theta.copy(), theta.copy()
        below[k] = max(theta[k] - reach, low[k])
        above[k] = min(theta[k] + reach, high[k])
        moved = model.residuals(above) - model.residuals(below)
        result[:, k] = moved / (above[k] - below[k])
    return result


def fit(
    model: JointModel,
    start: Array,
    weight: Array | None = None,
    iterations: int = 8,
    tolerance: float = 1e-3,
    known_jacobian: Array | None = None,
) -> Fit:
    """Fit the free parameters of a joint from coordinates (n,), residuals times `weight`."""
    # Weights are at most 1, where an error of form is allowed for. It stops when a step lowers the
    # cost by less than the tolerance's share.
    known = None if known_jacobian is None else Secants.at(known_jacobian, weight)
    objective = _OneJoint(model, weight)
    return _fit_of(model, minimise(objective, start, Effort(iterations, tolerance), known))


def broyden_fit(
    model: JointModel,
    start: Array,
    known_jacobian: Array,
    steps: int,
    weight: Array | None = None,
) -> Fit:
    """Fit by few simulations: a derivative that is known near `start` is updated, never renewed."""
    effort = Effort(steps, renewal=Renewal.NEVER)
    known = Secants.at(known_jacobian, weight)
    return _fit_of(model, minimise(_OneJoint(model, weight), start, effort, known))


def _fit_of(model: JointModel, found: Minimum[Array, Secants]) -> Fit:
    return Fit(
        model,
        found.theta,
        found.residuals,
        found.derivative.whole,
        found.cost,
        steps=found.steps,
        ended=found.ended,
    )


@dataclass(frozen=True)
class _OneJoint:
    model: JointModel
    weight: Array | None = None

    def bounds(self) -> tuple[Array, Array]:
        return self.model.bounds()

    def evaluate(self, theta: Array) -> tuple[Array, float]:
        residuals = self.model.residuals(theta)
        return residuals, self.model.cost(self._weighted(residuals), theta)

    def derivative(self, theta: Array, residuals: Array, stride: float) -> Secants:
        return Secants.at(jacobian(self.model, theta), self.weight)

    def normal_equations(
        self, theta: Array, residuals: Array, derivative: Secants
    ) -> tuple[Array, Array]:
        prior_weight = self.model.prior_weight()
        return (
            derivative.gram + np.diag(prior_weight**2),
            derivative.towards(residuals) + prior_weight * self.model.prior(theta),
        )

    def updated(self, derivative: Secants, step: Array, before: Array, after: Array) -> Secants:
        return derivative.updated(step, before, after)

    def _weighted(self, residuals: Array) -> Array:
        return residuals if self.weight is None else self.weight * residuals
