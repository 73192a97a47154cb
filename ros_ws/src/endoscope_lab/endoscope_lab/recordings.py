"""`endoscope bench recordings`: what is said of the simulated slave's own recordings."""

import argparse
import math
import os
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import open_bag
from endoscope_bags.copying import cut
from endoscope_bringup.demo.live_graph import LiveGraph
from endoscope_core.errors import EndoscopeError
from endoscope_core.physics import JointParameters, PlantDescription, save_plant
from endoscope_core.physics.family import shipped_family
from endoscope_explain.explanation import Verdict
from endoscope_explain.many_bags import explained_case
from endoscope_explain.pipeline import Sources
from endoscope_explain.report.sentences import verdict_sentence
from endoscope_lab.bench import keep_row, rows_so_far, side_by_side, table_head, table_row
from endoscope_nodes.names import JOINTS, MASTER_NODE


def run(args: argparse.Namespace) -> int:
    """Print a line for each recording and a table; return 0."""
    args.out.mkdir(parents=True, exist_ok=True)
    kept = args.out / 'rows.jsonl'
    rows = {row.seed: row for row in rows_so_far(kept, Row)}
    calls = [(seed, args.out) for seed in args.seeds if seed not in rows]
    for done, (_, future) in enumerate(
        side_by_side(args.jobs, recorded_and_explained, calls), len(args.seeds) - len(calls) + 1
    ):
        row = future.result()
        rows[row.seed] = row
        keep_row(kept, row)
        print(
            f'{done} of {len(args.seeds)}: seed {row.seed}, {row.way}; {row.length:.1f} s, load '
            f'{row.load:.1f}: {row.sentence} ({row.seconds:.0f} s)',
            flush=True,
        )
    _print_table([rows[seed] for seed in args.seeds])
    return 0


def _print_table(rows: list['Row']) -> None:
    verdicts = sorted({row.verdict for row in rows})
    print(table_head('made in', 'recordings', *verdicts, 'physics named'))
    for way in ('lock-step', 'real time', ''):
        of_way = [row for row in rows if row.way.startswith(way)]
        counts = [sum(row.verdict == verdict for row in of_way) for verdict in verdicts]
        named = sum(row.names_physics for row in of_way)
        print(table_row(way or 'all', len(of_way), *counts, named))


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


REFUSED = 'refused'
UNNAMED = (Verdict.CONSISTENT, Verdict.PARAMETERS_DIFFER, Verdict.INSUFFICIENT_DATA, REFUSED)


@dataclass(frozen=True)
class Row:
    """What was said of one recording."""

    seed: int
    way: str  # how it was made
    length: float  # in s, once cut
    verdict: str
    sentence: str
    load: float  # of the machine while it was made
    seconds: float  # time to make and explain it

    @property
    def names_physics(self) -> bool:
        """Whether something is said to be missing or wrong, which nothing is."""
        return self.verdict not in UNNAMED


def recorded_and_explained(seed: int, folder: Path) -> Row:
    """Make the recording of a seed in a folder, where it stays, and explain it."""
    begun = time.monotonic()
    case = drawn(seed)
    home = folder / f'{seed}'
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir(parents=True)
    plant = PlantDescription(dict.fromkeys(JOINTS, case.joint))
    save_plant(plant, home / 'plant.yaml')
    overrides: dict[str, dict[str, object]] = {
        'motor_driver': {'seed': seed, 'plant_file': str(home / 'plant.yaml')},
        'calibration': {'motion': case.calibration},
    }
    ended = ''
    with LiveGraph(home / 'whole', lock_step=case.lock_step, overrides=overrides) as graph:
        try:
            act(graph, case)
        except EndoscopeError as error:
            # A busy machine, or a motion that the graph refuses: what was recorded is explained.
            ended = f'; ended by: {error}'
        graph.stop()
    load = os.getloadavg()[0]
    whole = open_bag(home / 'whole')
    length = (whole.end_ns - whole.start_ns) * 1e-9
    begin, end = case.cut[0] * length, (1.0 - case.cut[1]) * length
    if end - begin < LEAST_S:
        begin, end = 0.0, length
    cut(home / 'whole', home / 'cut', begin, end)
    shutil.rmtree(home / 'whole')
    try:
        explained = explained_case(Sources(home / 'cut', plant, quick=True))
        verdict, sentence = str(explained.verdict), verdict_sentence(explained)
    except EndoscopeError as error:
        # A stretch in which nothing was commanded.
        verdict, sentence = REFUSED, str(error)
    way = 'lock-step' if case.lock_step else 'real time'
    return Row(
        seed,
        f'{way}: {", ".join(case.actions)}{ended}',
        end - begin,
        verdict,
        sentence,
        load,
        time.monotonic() - begun,
    )
