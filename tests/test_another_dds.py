"""A program that speaks DDS without ROS, by another implementation, reads and drives the graph."""

import json
import subprocess
import sys
import threading
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from doc_pages import WORKSPACE, blocks
from operated_graph import OperatedGraph
from simulated_graph import TICK_RATE

from endoscope_bags.message_types import TF_MESSAGE, message_type
from endoscope_core.rig import shipped_rig
from endoscope_nodes.graph import SHOWING_NODES
from endoscope_nodes.names import (
    JOINTS,
    MOTOR_MEASURED,
    MOTORS,
    OPERATING_STATE,
    SLAVE_MEASURED,
    TRANSFORMS,
    WIRES,
    WIRES_MEASURED,
)
from endoscope_nodes.nodes.instrument_model import section_of

pytestmark = pytest.mark.nightly

PAGE = WORKSPACE / 'doc/other_programs.md'
STREAMS = {MOTOR_MEASURED: MOTORS, WIRES_MEASURED: WIRES, SLAVE_MEASURED: JOINTS}
ENOUGH = {MOTOR_MEASURED: 500, WIRES_MEASURED: 500, SLAVE_MEASURED: 40}


class ForeignParticipant:
    """The process of a participant, what it was told and what it hears."""

    def __init__(self, graph: OperatedGraph, folder: Path) -> None:
        for block in blocks(PAGE):
            if block.name:
                (folder / block.name).write_text(block.text)
        self.heard = defaultdict(list)
        program = Path(__file__).with_name('foreign_participant.py')
        self._process = subprocess.Popen(
            [sys.executable, str(program), str(folder)],
            env=graph.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
        )
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self) -> None:
        for line in self._process.stdout:
            topic, values = json.loads(line)
            self.heard[topic].extend(values if isinstance(values, list) else [values])

    def tell(self, line: str) -> None:
        print(line, file=self._process.stdin, flush=True)

    def close(self) -> int:
        self._process.stdin.close()
        status = self._process.wait(60)
        self._thread.join()
        return status


@pytest.fixture(scope='module')
def graph(tmp_path_factory):
    with OperatedGraph(tmp_path_factory.mktemp('operated'), SHOWING_NODES, TICK_RATE) as graph:
        graph.said = {topic: graph.listen(topic, names) for topic, names in STREAMS.items()}
        graph.set('master', source='master')
        graph.enable()
        yield graph


@pytest.fixture(scope='module')
def foreigner(graph, tmp_path_factory):
    foreigner = ForeignParticipant(graph, tmp_path_factory.mktemp('page'))
    yield foreigner
    assert foreigner.close() == 0


def travel(samples) -> float:
    return float(np.ptp([s.position for s in samples], axis=0).max())


def while_(graph, seconds, samples):
    """Let time go on; the samples that came in it."""
    begin, end = len(samples), graph.clock.now_ns + round(seconds * 1e9)
    graph.until(lambda: graph.clock.now_ns >= end)
    return samples[begin:]


def test_who_joins_late_is_given_the_latched_state(graph, foreigner):
    # Simulated time stands still, so nothing is repeated.
    graph.wait(lambda: foreigner.heard[OPERATING_STATE])
    assert foreigner.heard[OPERATING_STATE] == ['ENABLED']


def test_it_reads_what_was_published_to_the_last_bit(graph, foreigner):
    graph.until(lambda: all(len(foreigner.heard[t]) >= n for t, n in ENOUGH.items()))
    for topic, names in STREAMS.items():
        published = {s.stamp_ns: s for s in graph.said[topic]}
        heard = list(foreigner.heard[topic])
        stamps = [stamp for stamp, *_ in heard]
        assert stamps == sorted(set(stamps)), topic
        for stamp, name, *values in heard:
            assert tuple(name) == names
            sent = published[stamp]
            assert [tuple(v) for v in values] == [sent.position, sent.velocity, sent.effort]


def test_it_reads_where_the_links_are_though_nobody_here_has_the_package_of_the_type(
    graph, foreigner
):
    section = section_of(shipped_rig().instrument)
    graph.until(lambda: len(foreigner.heard[TRANSFORMS]) > 10)
    bent = {s.stamp_ns: s.position for s in graph.said[SLAVE_MEASURED]}
    compared = 0
    for links in list(foreigner.heard[TRANSFORMS]):
        [stamp] = {stamp for stamp, *_ in links}
        frames = [(parent, child) for _, parent, child, _ in links]
        assert frames == [(h.parent, h.child) for h in section.hinges]
        if stamp in bent:
            due = section.transforms(section.joint_angles(bent[stamp]))
            assert [pose for *_, pose in links] == [[*p.translation, *p.rotation] for p in due]
            compared += 1
    assert compared > 5
    [sender] = graph.nodes['instrument_model'].get_publishers_info_by_topic(TRANSFORMS)
    assert sender.topic_type == TF_MESSAGE
    assert str(sender.topic_type_hash) == message_type(TF_MESSAGE).type_hash


def test_the_slave_follows_its_handle_while_the_clutch_is_held(graph, foreigner):
    assert while_(graph, 0.5, graph.goals) == []
    foreigner.tell('hold')
    graph.until(lambda: graph.reported('master: commands')['following'] == 'True')
    before = graph.wanted[-1].position
    # Further than is waited for: a handle that is silent for once is followed anew from there.
    foreigner.tell('move 0.8')
    graph.until(lambda: graph.wanted[-1].position[0] > before[0] + 0.39)
    assert abs(graph.wanted[-1].position[1] - before[1]) < 1e-3
    moved = graph.goals[-1].position[0]
    assert moved > 0.5 * 0.39, 'gear times the motion, and what is compensated on top'
    graph.until(lambda: foreigner.heard[MOTOR_MEASURED][-1][2][0] > 0.9 * moved)
    assert graph.state == 'ENABLED'


def test_the_slave_holds_from_the_release_on_however_the_handle_moves(graph, foreigner):
    foreigner.tell('release')
    foreigner.tell('move -0.2')
    graph.until(lambda: graph.reported('master: commands')['clutch held'] == 'False')
    held = graph.goals[-1].position
    moving = while_(graph, 2.5, graph.goals)
    assert all(goal.position == held for goal in moving)
    # What the handle did meanwhile is no motion: a new grip begins where the slave is.
    known = len(graph.wanted)
    foreigner.tell('hold')
    graph.until(lambda: len(graph.wanted) > known)
    pose = graph.said[SLAVE_MEASURED][-1].position
    np.testing.assert_allclose(graph.wanted[known].position, pose, atol=0.03)
    assert travel(while_(graph, 0.5, graph.wanted)) < 0.002
    assert graph.state == 'ENABLED'


def test_its_orders_are_obeyed_and_it_hears_so(graph, foreigner):
    foreigner.tell('release')
    foreigner.tell('order disable')
    graph.until(lambda: graph.state == 'DISABLED')
    graph.until(lambda: foreigner.heard[OPERATING_STATE][-1] == 'DISABLED')
