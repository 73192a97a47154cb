"""What every peer gets of a case: what the refitted plant leaves, and the plant's states."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from endoscope_core.physics import layout
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_explain.fit.free_parameters import BAND
from endoscope_explain.fit.model import Fit, simulate_joint
from endoscope_explain.fit.nominal import with_references
from endoscope_explain.observe.observation import (
    Channel,
    JointObservation,
    observe,
    with_held_noise,
)
from endoscope_lab.concealed.judge import Case, Statement

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SIGNALS = (
    layout.OUT_MOTOR, layout.OUT_EFFORT, layout.OUT_TENSION_A, layout.OUT_TENSION_B,
    layout.OUT_BENDING,
)  # fmt: skip
"""Columns of the residuals, as the plant's outputs: shaft angle, effort, wires, bending angle."""
PERIOD_S = 0.025
"""Of the grid: the tracker's."""
BLOCK_S = 1.2
"""Length of a block; every third is held out."""
LEVEL = 0.05
"""Chance to name something where a model does not predict held-out blocks any better."""


@dataclass(frozen=True)
class OwnExample:
    """What a peer must give on an example of its authors', and what it gave here."""

    what: str
    must: str
    gave: str
    works: bool


@dataclass(frozen=True)
class Reply:
    """What a peer says of a problem."""

    statement: Statement | None  # what is missing
    # Intervals in s in which it is; None from a peer that says nothing of where.
    intervals: tuple[tuple[float, float], ...] | None = None
    report: str = ''  # what else it says, where it cannot name anything


@dataclass(frozen=True)
class Problem:
    """One joint of a case, M samples on a common grid."""

    joint: str  # the one of which the refitted plant leaves most
    refitted: Fit  # of the nominal plant
    described: Fit  # of the same, with the numbers as described
    time: Array  # (M,), in s from the first command
    # (M, 5): measured less simulated, in noise units, of each of `SIGNALS`.
    residuals: Array
    # (M,) each along the simulation, in SI units: time t, command u, servo error e, shaft angle m
    # with its derivatives dm, ddm, bending angle q with dq, ddq, sliding speed v, distance slid d,
    # tensions at the motor ta and tb, their mean T and difference D, the other joint's angle.
    states: Mapping[str, Array]

    @property
    def held_out(self) -> Mask:
        """Samples (M,) that are not used for fitting."""
        return is_held_out(self.time)

    @property
    def loudest(self) -> int:
        """Column of the residuals that is largest."""
        return int(np.argmax(np.mean(self.residuals**2, axis=0)))

    @property
    def sensor_to_blame(self) -> int | None:
        """The loudest column if it holds more of the squares beyond noise than all others."""
        excess = np.maximum(np.mean(self.residuals**2, axis=0) - 1.0, 0.0)
        return self.loudest if excess[self.loudest] > 0.5 * np.sum(excess) else None

    def says(self, name: str) -> Statement:
        """The statement that an effect, or a function at a place, is missing."""
        definition = CATALOGUE[name] if name in CATALOGUE else FUNCTIONS[name]
        return Statement(name, self.joint, str(definition.stage))


def problem_of(case: Case) -> Problem:
    """Refit the nominal plant to a case's recording, and pose the problem that it leaves."""
    plant = case.described
    observed = with_held_noise(observe(case.recording, plant))
    _, references = with_references(case.recording, observed, plant, BAND, 1)
    refitted, described = max(references, key=lambda pair: float(np.mean(pair[0].residuals ** 2)))
    observation = refitted.model.observation
    end = min(float(channel.time[-1]) for channel in observation.channels)
    grid = np.arange(2.0 * PERIOD_S, end - PERIOD_S, PERIOD_S)
    residuals = on_grid(observation, -refitted.residuals, grid)
    joint, states = observation.joint, _states(refitted, grid)
    return Problem(joint, refitted, described, grid, residuals, states)


def on_grid(observation: JointObservation, values: Array, grid: Array) -> Array:
    """Values (size,) of all channels on a grid (M,) in s, of each of `SIGNALS` (M, 5)."""
    found = np.zeros((len(grid), len(SIGNALS)))
    for channel, part in zip(observation.channels, observation.slices(), strict=True):
        if channel.output in SIGNALS:
            found[:, SIGNALS.index(channel.output)] = _on_grid(channel, values[part], grid)
    return found


def is_held_out(time: Array) -> Mask:
    """Which samples (M,) at times in s belong to blocks that are held out."""
    return np.asarray((time // BLOCK_S).astype(int) % 3 == 2)


def predicts(time: Array, before: Array, after: Array) -> bool:
    """Whether squares of held-out samples (K,) are less with a model: a t-test of log ratios."""
    # One rule for all peers, since few have one of their own by which they say nothing.
    block = (time // BLOCK_S).astype(int)
    means = [(np.mean(before[block == b]), np.mean(after[block == b])) for b in np.unique(block)]
    gains = np.array([np.log(without / left) for without, left in means])
    spread = float(np.std(gains, ddof=1)) / np.sqrt(len(gains))
    return bool(np.mean(gains) > student.ppf(1.0 - LEVEL, len(gains) - 1) * spread)


def _on_grid(channel: Channel, values: Array, grid: Array) -> Array:
    index = np.round((channel.time - grid[0]) / PERIOD_S).astype(int)
    inside = (index >= 0) & (index < len(grid))
    total = np.bincount(index[inside], values[inside], len(grid))
    number = np.bincount(index[inside], minlength=len(grid))
    known = number > 0
    return np.interp(grid, grid[known], total[known] / number[known])


def _states(refitted: Fit, grid: Array) -> dict[str, Array]:
    model = refitted.model
    parameters, _ = model.packed(refitted.theta)
    out = simulate_joint(model.observation, parameters, model.flags)
    inputs, tick = model.observation.inputs[0], model.observation.tick
    m, dm, q = (out[:, k] for k in (layout.OUT_MOTOR, layout.OUT_MOTOR_SPEED, layout.OUT_JOINT))
    ta, tb, dq = out[:, layout.OUT_TENSION_A], out[:, layout.OUT_TENSION_B], np.gradient(q, tick)
    v = 0.5 * (parameters[layout.PULLEY_RADIUS] * dm + parameters[layout.JOINT_RADIUS] * dq)
    u = inputs[:, layout.IN_COMMAND]
    on_ticks = {
        'u': u, 'e': m - u, 'm': m, 'dm': dm, 'ddm': np.gradient(dm, tick),
        'q': q, 'dq': dq, 'ddq': np.gradient(dq, tick), 'v': v, 'd': tick * np.cumsum(np.abs(v)),
        'ta': ta, 'tb': tb, 'T': 0.5 * (ta + tb), 'D': ta - tb,
        'other': inputs[:, layout.IN_OTHER_JOINT],
    }  # fmt: skip
    time = tick * np.arange(len(out))
    return {'t': grid} | {name: np.interp(grid, time, x) for name, x in on_ticks.items()}
