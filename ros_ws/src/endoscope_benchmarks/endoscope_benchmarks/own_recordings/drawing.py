"""What somebody does with the graph while it is recorded, drawn by seed."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_bringup.demo.live_graph import LiveGraph
from endoscope_core.physics import JointParameters
from endoscope_core.physics.family import shipped_family
from endoscope_nodes.names import JOINTS, MASTER_NODE

Generator = np.random.Generator
Action = Callable[[LiveGraph, Generator], None]

LEAST_S = 4.0
"""Of a recording, once it is cut."""
LEAVES_WHOLE = 0.3
"""Share of the recordings that are not cut at an end."""
REAL_TIME = 0.3
NOMINAL = 0.5
"""Share of the recordings of the nominal slave; the others are of tubes of the family."""


@dataclass(frozen=True)
class Case:
    """One recording."""

    seed: int
    lock_step: bool
    joint: JointParameters  # of the slave
    actions: tuple[str, ...]  # names in `ACTIONS`
    calibration: str  # motion by which the tube is calibrated
    # Share of the recording that is left out at its beginning and at its end.
    cut: tuple[float, float]


def drawn(seed: int) -> Case:
    """The case of a seed."""
    rng = np.random.default_rng(seed)
    moving = [name for name in ACTIONS if name in MOVING]
    other = [name for name in ACTIONS if name not in MOVING]
    actions = [str(rng.choice(moving))]
    for _ in range(int(rng.integers(1, 4))):
        actions += [str(rng.choice(other)), str(rng.choice(moving))]
    cut = [0.0 if rng.random() < LEAVES_WHOLE else float(rng.uniform(0.0, 0.45)) for _ in range(2)]
    bend = float(rng.uniform(0.0, math.radians(240.0)))
    return Case(
        seed,
        rng.random() >= REAL_TIME,
        JointParameters() if rng.random() < NOMINAL else shipped_family().joint(bend),
        tuple(actions),
        str(rng.choice(['sinusoid', 'brief'])),
        (cut[0], cut[1]),
    )


def act(graph: LiveGraph, case: Case) -> None:
    """Do all that was drawn."""
    rng = np.random.default_rng([case.seed, 1])
    graph.client.ask('enable')
    for name in case.actions:
        ACTIONS[name](graph, rng)
    graph.advance(float(rng.uniform(0.0, 2.0)))


def _console(graph: LiveGraph, rng: Generator) -> None:
    motion = str(rng.choice(['periodic', 'non_periodic', 'calibration']))
    joints = [list(JOINTS), list(JOINTS), [JOINTS[0]], [JOINTS[1]]][int(rng.integers(4))]
    graph.set(MASTER_NODE, source='motion', motion=motion, joints=joints)
    graph.advance(float(rng.uniform(3.0, 8.0)))
    graph.set(MASTER_NODE, source='none')


def _teleop(graph: LiveGraph, rng: Generator) -> None:
    # A key held makes a speed, released it stands still.
    legs = rng.uniform(0.3, 1.2, 8).cumsum()
    speeds = np.asarray(0.8 * rng.integers(-1, 2, (8, len(JOINTS))), dtype=np.float64)
    seconds = float(rng.uniform(3.0, 6.0))
    graph.hold_handle(lambda since: _legs(since, legs, speeds), 100.0, seconds)


def _handle(graph: LiveGraph, rng: Generator) -> None:
    size = rng.uniform(0.2, 0.9, (3, len(JOINTS))) / np.array([[1.0], [2.0], [3.0]])
    rate = rng.uniform(0.5, 4.0, (3, len(JOINTS)))
    phase = rng.uniform(0.0, 2.0 * math.pi, (3, len(JOINTS)))

    def angles(since: float) -> list[float]:
        return list((size * (np.sin(rate * since + phase) - np.sin(phase))).sum(axis=0))

    graph.hold_handle(angles, 50.0, float(rng.uniform(3.0, 6.0)))


def _legs(since: float, ends: NDArray[np.float64], speeds: NDArray[np.float64]) -> list[float]:
    begins = np.concatenate([[0.0], ends[:-1]])
    spent = np.clip(since - begins, 0.0, ends - begins)
    return list(np.clip(spent @ speeds, -1.0, 1.0))


def _calibrate(graph: LiveGraph, rng: Generator) -> None:
    graph.client.calibrate()


def _rest(graph: LiveGraph, rng: Generator) -> None:
    graph.advance(float(rng.uniform(0.5, 4.0)))


def _pause(graph: LiveGraph, rng: Generator) -> None:
    graph.client.ask('pause')
    _rest(graph, rng)
    graph.client.ask('resume')


def _disable(graph: LiveGraph, rng: Generator) -> None:
    graph.client.ask('disable')
    _rest(graph, rng)
    graph.client.ask('enable')


def _home(graph: LiveGraph, rng: Generator) -> None:
    graph.client.home()


def _fault(graph: LiveGraph, rng: Generator) -> None:
    """Load cells that fall silent while the slave moves."""
    graph.set(MASTER_NODE, source='motion', motion='periodic', joints=list(JOINTS))
    graph.advance(float(rng.uniform(1.0, 3.0)))
    graph.set('load_cells', connected=False)
    graph.client.wait_for(lambda: graph.client.state == 'FAULT', 'FAULT')
    graph.set(MASTER_NODE, source='none')
    graph.set('load_cells', connected=True)
    _rest(graph, rng)
    graph.client.ask('disable')
    graph.client.ask('enable')


ACTIONS: dict[str, Action] = {
    'console': _console,
    'teleop': _teleop,
    'handle': _handle,
    'calibrate': _calibrate,
    'rest': _rest,
    'pause': _pause,
    'disable': _disable,
    'home': _home,
    'fault': _fault,
}
MOVING = ('console', 'teleop', 'handle', 'calibrate')
