"""The rig as one nominal plant with wide priors, and the residual of a plant on a recording."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import EffectSpec, JointParameters, PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.layout import JOINT_RADIUS
from endoscope_explain.fit.evidence import mean_squares, weights
from endoscope_explain.fit.free_parameters import LEAD, effect_parameters, nominal_parameters
from endoscope_explain.fit.model import Fit, JointModel, fit, packed_joint
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.search.term import with_effect
from endoscope_lab.real.takes import JOINT, Take

Array = NDArray[np.float64]

ASYMMETRY = 0.0415
"""Of the rig's own kinematics, three hinges whose wires pass them at 1.2 mm and 0.3 mm: the part
with the cosine is 27 um at 60 deg."""
ZERO = 'load_cell_bias'
"""The zero of the first cell was never checked: slack, it still reads 0.8 N. It is fitted."""
AGE = 'load_cell_delay'
"""Latency of the cells, of which the rig's program shows only a part."""
PLANT = PlantDescription(
    {JOINT: JointParameters()},
    effects=(
        EffectSpec('wire_geometry', JOINT, {'asymmetry': ASYMMETRY}),
        EffectSpec(ZERO, JOINT, {'bias_n': 0.0, 'wire': 0.0}),
        EffectSpec(AGE, JOINT, {'delay_s': 0.0}),
    ),
)
"""The described plant: a nominal tube whose bending section has no friction of its own, with the
rig's kinematics and cells."""
SERVO = ('motor_bandwidth', 'motor_damping_ratio')
"""The motors' currents show their lag, 55 to 92 ms, so that these keep the usual tolerance."""
REAL_BAND = 3.0
"""Tolerance of all other parameters: five times the described ones, or a fifth."""
STANDS, STEPS = 1e-5, 60
"""Convergence tolerance (share of the cost) and largest number of steps of a fit."""


def wide(observation: JointObservation) -> JointModel:
    """The nominal plant with all its parameters free, including the joint's radius."""
    base, flags = packed_joint(PLANT, JOINT)
    servo = {p.index: p for p in nominal_parameters(base) if p.name in SERVO}
    free = [
        servo.get(p.index, p)
        for p in nominal_parameters(base, REAL_BAND)
        if p.index not in (LEAD, JOINT_RADIUS)
    ]
    like = next(p for p in free if p.name == 'joint_stiffness')
    centre, reach = float(base[JOINT_RADIUS]), like.high / math.exp(like.mean)
    radius = replace(
        like,
        index=JOINT_RADIUS,
        name='joint_radius',
        low=centre / reach,
        high=centre * reach,
        mean=math.log(centre),
    )
    # Derivatives are taken on the same ticks.
    free += [radius, *effect_parameters(ZERO), *effect_parameters(AGE)]
    return JointModel(observation, base, flags, tuple(free), coarse=1)


def as_described(model: JointModel) -> Array:
    """Coordinates of the described plant in the wide one."""
    return np.array([item.mean for item in model.free])


@dataclass(frozen=True)
class Plant:
    """A fitted plant, without a recording."""

    model: JointModel  # with the recording of its fit
    theta: Array  # (n,)

    @staticmethod
    def of(found: Fit) -> 'Plant':
        return Plant(found.model, found.theta)

    def held(self, free: Sequence[str], observation: JointObservation) -> 'Plant':
        """The plant on another recording, with only the parameters `free` left to fit."""
        base, _ = self.model.packed(self.theta)
        kept = [k for k, item in enumerate(self.model.free) if item.name in free]
        items = tuple(self.model.free[k] for k in kept)
        model = replace(self.model, observation=observation, base=base, free=items)
        return Plant(model, self.theta[kept])

    def on(self, observation: JointObservation) -> 'Plant':
        return Plant(replace(self.model, observation=observation), self.theta)

    def with_cell_of_unknown_unit(self) -> 'Plant':
        """The plant with the gain of the second cell as a free parameter."""
        start = {'gain': 1.0, 'wire': 1.0}
        model = with_effect(self.model, CATALOGUE['load_cell_gain'], start)
        return Plant(model, model.begun_at(self.theta))

    def refitted(self) -> Fit:
        """Fit the free parameters to convergence, with channels weighted by their residuals."""
        found = fit(self.model, self.theta, self._weight(self.theta), STEPS, 1e-2)
        for tolerance in (1e-3, STANDS):
            found = fit(self.model, found.theta, self._weight(found.theta), STEPS, tolerance)
        return found

    def _weight(self, theta: Array) -> Array:
        return weights(self.model.observation, self.model.residuals(theta))

    def predicted(self) -> list[Array]:
        """Readings of each channel, as simulated."""
        observation = self.model.observation
        residuals = self.model.residuals(self.theta)
        return [
            c.value + residuals[part] * c.noise
            for c, part in zip(observation.channels, observation.slices(), strict=True)
        ]


def best_refitted(plants: Sequence[Plant]) -> Fit:
    """The fit with the least residual, of several starts on one recording."""
    fits = [plant.refitted() for plant in plants]
    return min(fits, key=lambda f: np.log(mean_squares(f.model.observation, f.residuals)).sum())


@dataclass(frozen=True)
class JudgedTake:
    """One recording, and plants that are judged on a part of it."""

    take: Take
    begin: float  # of the judged part, s
    plants: Mapping[str, Plant]  # on the whole recording; keys are those of the report's plants
    end: float = math.inf  # of the judged part, s

    def left(self, name: str) -> tuple[float, ...]:
        """Rms residual of a plant: angle in rad, then tensions in N."""
        plant, found = self.plants[name], []
        for channel, values in zip(
            plant.model.observation.channels, plant.predicted(), strict=True
        ):
            judged = (channel.time >= self.begin) & (channel.time < self.end)
            error = (values - channel.value)[judged]
            found.append(float(np.sqrt(np.mean(error**2))))
        return (found[-1], *found[:-1])
