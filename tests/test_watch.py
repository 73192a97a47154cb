"""The watch among the real nodes: quiet on a rig as described, and it reports one that changes."""

import json
import re

import numpy as np
import pytest
from doc_pages import ROOT, WORKSPACE
from operated_graph import OperatedGraph
from sensor_msgs.msg import JointState
from simulated_graph import SimulatedGraph
from std_srvs.srv import Trigger

from endoscope_bags import open_bag
from endoscope_bags.cdr import encode_joint_state
from endoscope_bags.event_bag import event_bags, events_of
from endoscope_bringup.operating.status import status_of
from endoscope_core.physics import EffectSpec, PlantDescription, save_plant
from endoscope_core.signals.sampled_motion import write_command_file
from endoscope_explain.recording import recording_from_bag
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.graph import ALL_NODES
from endoscope_nodes.names import SLAVE_MEASURED, WATCH_RESTART
from endoscope_nodes.nodes.watch import WatchNode
from endoscope_nodes.runtime.diagnostics import OK, WARN
from endoscope_nodes.runtime.qos import SENSOR_OFFERED

CHANGED_AT, SECONDS = 48.0, 60.0
"""Of the simulated plant: when its tube is bent more, and how long it moves."""


@pytest.fixture(scope='module')
def files(tmp_path_factory):
    """A described plant, one whose tube is bent more while it moves, and a motion."""
    folder = tmp_path_factory.mktemp('watch')
    save_plant(PlantDescription(), folder / 'described.yaml')
    bent = EffectSpec('configuration_change', 'bend_x', {'time_s': CHANGED_AT, 'factor': 1.8})
    save_plant(PlantDescription(effects=(bent,)), folder / 'true.yaml')
    time = np.arange(0.0, SECONDS, 0.01)
    angles = [0.3 * (np.sin(w * time) + np.sin(np.sqrt(3.0) * w * time)) for w in (1.0, 1.3)]
    write_command_file(folder / 'motion.csv', time, np.stack(angles, axis=1))
    return folder


@pytest.fixture(scope='module')
def watched(files):
    """The graph with a watch that has reported the change; its status before and after."""
    overrides = {
        'watch': {'active': True, 'plant': str(files / 'described.yaml')},
        'motor_driver': {'plant_file': str(files / 'true.yaml')},
        'master': {'source': 'file', 'command_file': str(files / 'motion.csv')},
    }
    with OperatedGraph(files, extra=(WatchNode,), **overrides) as graph:
        graph.enable()
        graph.advance(25.0)
        # A tracker that has lost its sensor is no other rig.
        graph.set('em_tracker', in_volume=False)
        graph.advance(4.0)
        graph.set('em_tracker', in_volume=True)
        graph.advance(CHANGED_AT - 30.0)
        before = graph.diagnostics['watch: rig'][-1]
        # At rest the bag of the alarm comes to its end.
        graph.advance(SECONDS - CHANGED_AT + 5.0)
        yield graph, before


def content(status):
    return status.level, status.message, {v.key: v.value for v in status.values}


def restarted(graph):
    client = graph.probe.create_client(Trigger, WATCH_RESTART)
    future = client.call_async(Trigger.Request())
    graph.wait(future.done)
    return future.result()


def test_nothing_is_reported_before_anything_has_changed(watched):
    level, message, values = content(watched[1])
    assert level == OK
    assert message.startswith('the rig is as described')
    assert float(values['margin']) < 1.0
    assert float(values['bend_x learnt [s]']) == 20.0


def test_a_tube_that_is_bent_more_is_reported_with_stage_and_time(watched):
    graph, _ = watched
    level, message, values = content(graph.diagnostics['watch: rig'][-1])
    assert level == WARN
    assert message.startswith('bend_x no longer matches its plant: sheath')
    assert values['bend_x stage'].split(' or ')[0] == 'sheath'
    assert float(values['bend_x margin']) >= 1.0
    assert 'bend_y stage' not in values
    alarm = graph.nodes['watch'].rig_watch.alarms[0]
    assert alarm.at < CHANGED_AT + 10.0
    assert alarm.since == pytest.approx(CHANGED_AT, abs=3.0)


def test_the_bag_of_an_alarm_begins_before_the_change_and_can_be_explained(watched, files):
    [path] = event_bags(files)
    [event] = events_of(open_bag(path).metadata)
    assert event.reason.startswith('watch: bend_x no longer matches its plant: sheath')
    recording = recording_from_bag(path, PlantDescription())
    assert recording.duration > 45.0


def test_an_adopted_plant_is_the_one_that_is_compared_from_then_on(watched, files):
    graph, _ = watched
    graph.set('master', source='none')
    graph.advance(1.0)
    status, out, errors = graph.run('operate', 'adopt', str(files / 'described.yaml'), '--json')
    assert status == 0, out + errors
    graph.advance(2.0)
    level, message, values = content(graph.diagnostics['watch: rig'][-1])
    assert level == OK
    assert message.startswith('learning, 0 of 30 s')
    assert values['plant'] == f'adopted plant {json.loads(out)["plant"]}'
    assert float(values['bend_x learnt [s]']) == 0.0


def test_on_request_it_learns_anew(watched):
    graph, _ = watched
    graph.nodes['watch'].rig_watch.joints[0].test.learnt = 7
    answer = restarted(graph)
    assert answer.success
    graph.advance(2.0)
    assert graph.nodes['watch'].rig_watch.joints[0].test.learnt == 0


def test_messages_that_are_no_readings_are_counted_and_change_nothing(watched):
    graph, _ = watched
    stranger = graph.speak(JointState, SLAVE_MEASURED, SENSOR_OFFERED)
    stranger.publish(encode_joint_state(['elbow'], 0, position=[1.0]))
    graph.advance(2.0)
    level, _, values = content(graph.diagnostics['watch: rig'][-1])
    assert level == OK
    assert int(values['tracker unreadable']) >= 1


def test_it_starts_by_the_documented_line():
    page = (WORKSPACE / 'doc/operating.md').read_text()
    [line] = re.findall(r'^\$ graph (.*watch:active.*)$', page, re.MULTILINE)
    for file in ('docker/compose.yaml', 'ros_ws/src/endoscope_bringup/launch/endoscope.launch.py'):
        assert 'watch:active:=' in (ROOT / file).read_text()
    with SimulatedGraph(args=line.split(), extra=(WatchNode,)) as graph:
        assert graph.nodes['watch'].announcement.startswith('watching for a rig other than')
        graph.advance(2.0)
        assert content(graph.diagnostics['watch: rig'][-1])[1].startswith('learning, 0 of 30 s')
        with GraphClient(graph.probe, graph.advance) as client:
            client.find(1.0)
            lines, _ = status_of(client, 3.0)
    [line] = [line for line in lines if line.startswith('watch ')]
    assert 'learning, 0 of 30 s' in line


def test_by_default_it_is_there_and_hears_nothing():
    assert WatchNode in ALL_NODES
    with SimulatedGraph(extra=(WatchNode,)) as graph:
        graph.enable()
        graph.advance(1.2)
        assert content(graph.diagnostics['watch: rig'][-1]) == (OK, 'off', {})
        assert graph.nodes['watch'].extra_readers() == []
        answer = restarted(graph)
    assert not answer.success
    assert 'off' in answer.message
