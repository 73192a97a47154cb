"""`endoscope bench pauses`: whether the slave obeys after a rest, or says that it does not."""

import argparse
import itertools
import math
import random
from dataclasses import dataclass

from sensor_msgs.msg import JointState

from endoscope_bringup.demo.live_graph import LiveGraph
from endoscope_core.control.limits import COUNT
from endoscope_lab.bench import side_by_side, table_head, table_row
from endoscope_nodes.names import CALIBRATION_COMMAND, CALIBRATION_RUN, MASTER_NODE, SLAVE_COMMAND
from endoscope_nodes.runtime.qos import COMMAND


def run(args: argparse.Namespace) -> int:
    """Print a line for each rest and a table; return 1 if the graph was silent after one."""
    rows = []
    calls = [(seed, args.longest) for seed in args.seeds]
    for done, (_, future) in enumerate(side_by_side(args.jobs, rested_and_moved, calls), 1):
        row = future.result()
        rows.append(row)
        print(
            f'{done} of {len(calls)}: seed {row.seed}, {row.rest_s:.0f} s, then {row.asked}: '
            f'{row.became}, {row.within_s:.2f} s after the first command',
            flush=True,
        )
    return _print_table(rows)


def _print_table(rows: list['Row']) -> int:
    print(table_head('rest', 'rests', 'obeyed', 'refused and said', 'silent', 'latest [s]'))
    ends = (0.0, 10.0, 100.0, 1000.0, math.inf)
    bands = [*itertools.pairwise(ends), (0.0, math.inf)]
    for low, high in bands:
        of_band = [row for row in rows if low <= row.rest_s < high]
        obeyed = sum(row.became == 'obeyed' for row in of_band)
        silent = sum(row.became == 'silent' for row in of_band)
        latest = max((row.within_s for row in of_band), default=0.0)
        name = 'all' if (low, high) == bands[-1] else f'from {low:.0f} s'
        refused = len(of_band) - obeyed - silent
        print(table_row(name, len(of_band), obeyed, refused, silent, f'{latest:.2f}'))
    return int(any(row.became == 'silent' for row in rows))


ASKED = ('home', 'motion', 'handle', 'calibrate')
SAID_S = 0.5
RATE = 100
"""Beats of the graph in a second: an hour's rest is to be had in minutes."""
_STEP_S = 0.02
_FIRST_COMMAND_S = 3.0


@dataclass(frozen=True)
class Row:
    """What became of the motion after one rest.

    `rest_s`: length of the rest.
    `asked`: what was asked for after it.
    `became`: `obeyed`, `silent`, or why the graph says that it does not obey.
    `within_s`: after the first command, in the graph's time.
    """

    seed: int
    rest_s: float
    asked: str
    became: str
    within_s: float


def rested_and_moved(seed: int, longest_s: float) -> Row:
    """Move, rest and ask for motion again, as a seed draws it."""
    draw = random.Random(seed)
    rest_s = math.exp(draw.uniform(0.0, math.log(longest_s)))
    asked = draw.choice(ASKED)
    overrides: dict[str, dict[str, object]] = {'calibration': {'motion': 'brief'}}
    with LiveGraph(None, lock_step=True, overrides=overrides, rate=RATE) as graph:
        graph.client.ask('enable')
        graph.set(MASTER_NODE, source='motion')
        graph.advance(1.5)
        graph.set(MASTER_NODE, source='none')
        graph.advance(rest_s)
        return Row(seed, rest_s, asked, *_asked(graph, asked))


def _asked(graph: LiveGraph, what: str) -> tuple[str, float]:
    """What became of an order, and when."""
    commanded: list[float] = []
    for topic in (SLAVE_COMMAND, CALIBRATION_COMMAND):
        graph.client.listen(
            JointState, topic, lambda data, received_ns: commanded.append(graph.now()), qos=COMMAND
        )
    graph.advance(0.2)
    begin, before = graph.now(), graph.shafts
    result: list[tuple[str, float]] = []

    def look() -> bool:
        graph.client.hear()
        since = graph.now() - (commanded[0] if commanded else begin)
        moved = max(abs(a - b) for a, b in zip(graph.shafts, before, strict=True))
        if moved > 2.0 * COUNT:
            result.append(('obeyed', since))
        elif graph.client.state != 'ENABLED':
            result.append((f'{graph.client.state}: {graph.client.why}', since))
        elif since > (SAID_S if commanded else _FIRST_COMMAND_S):
            result.append(('silent', since))
        return bool(result)

    if what == 'handle':
        graph.hold_handle(lambda t: (0.0, 0.0) if look() else (0.4 * t, -0.4 * t), 50.0, 2.0)
    elif what == 'home':
        graph.client.order('home')
    elif what == 'motion':
        graph.set(MASTER_NODE, source='motion')
    else:
        graph.client.trigger(CALIBRATION_RUN)
    while not look():
        graph.advance(_STEP_S)
    return result[0]
