"""Programs that share no code with the project move the slave, each in a process of its own."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from doc_pages import WORKSPACE, blocks
from operated_graph import OperatedGraph
from sensor_msgs.msg import Joy

from endoscope_nodes.names import TIP_VELOCITY

PAGE = WORKSPACE / 'doc/other_programs.md'
SIMULATED = ('--ros-args', '-p', 'use_sim_time:=true')


@pytest.fixture(scope='module')
def graph(tmp_path_factory):
    with OperatedGraph(tmp_path_factory.mktemp('operated')) as graph:
        yield graph


def start(graph, program, *words):
    return subprocess.Popen(
        [sys.executable, str(program), *words, *SIMULATED],
        env=graph.environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_a_crtk_client_bends_the_slave_by_velocities_and_stops_it(graph):
    client = start(graph, Path(__file__).with_name('foreign_crtk_client.py'), '1.0')
    status, said, errors = graph.finish(client)
    assert status == 0, errors
    told = json.loads(said)
    assert (told['enabled'], told['stopped']) == ('ENABLED', 'PAUSED')
    assert 0.25 < told['way'][0] < 0.45
    assert told['way'][1] == pytest.approx(-0.5 * told['way'][0], abs=0.02)
    assert len(graph.goals) > 50


def test_a_gamepad_by_the_script_of_the_page_turns_the_tip_while_its_button_is_held(
    graph, tmp_path
):
    script = tmp_path / 'joy_to_twist.py'
    script.write_text(next(b.text for b in blocks(PAGE) if b.name == script.name))
    assert 'endoscope_' not in script.read_text()
    pad = graph.speak(Joy, '/joy', 10)
    program = start(graph, script)
    try:
        graph.until(lambda: graph.probe.count_publishers(TIP_VELOCITY), 'the script')
        graph.until(lambda: graph.probe.count_subscribers('/joy'), 'the script')
        graph.command('disable')
        graph.enable()
        graph.wanted.clear()

        def hold(button, stick, seconds):
            end = graph.clock.now_ns + round(seconds * 1e9)
            while graph.clock.now_ns < end:
                pad.publish(Joy(buttons=[button], axes=stick))
                graph.pace()

        hold(0, [1.0, 0.0], 0.5)
        assert graph.wanted == []
        hold(1, [1.0, 0.0], 1.0)
        way = np.ptp([sample.position for sample in graph.wanted], axis=0)
        assert 0.2 < way[0] < 0.6
        assert way[1] < 0.02
        hold(0, [1.0, 0.0], 0.3)
        graph.wanted.clear()
        hold(0, [1.0, 0.0], 0.3)
        assert graph.wanted == []
        assert graph.state == 'ENABLED'
    finally:
        program.kill()
        program.communicate()
