"""A rest within a motion session of the simulated graph, and what becomes of the next motion."""

import math
import random
from dataclasses import dataclass

from sensor_msgs.msg import JointState

from endoscope_bringup.demo.live_graph import LiveGraph
from endoscope_core.control.limits import COUNT
from endoscope_nodes.names import CALIBRATION_COMMAND, CALIBRATION_RUN, MASTER_NODE, SLAVE_COMMAND
from endoscope_nodes.runtime.qos import COMMAND

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
