"""Where all is simulated, time waits for the machine; a person's hand does not wait for time."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from commanded_graph import Handle
from node_program import code_of
from rclpy.context import Context
from rclpy.node import Node
from simulated_graph import SimulatedGraph

from endoscope_bringup.operating.status import status_of
from endoscope_core.rig import load_rig
from endoscope_nodes.client.graph_client import joined_graph
from endoscope_nodes.client.graph_listener import LOCK_STEP
from endoscope_nodes.client.graph_parameters import set_parameters
from endoscope_nodes.graph import compose
from endoscope_nodes.names import FACTOR, GEAR
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.runtime import Runtime

PATIENCE_S = 240.0
_SECTION = '/**/load_cells: {ros__parameters: {device: modbus_tcp}}\n'


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    """A graph as a person starts it, and whoever asks it."""
    domain = private_domain()
    process = subprocess.Popen(
        [
            *(sys.executable, '-c', code_of('graph')),
            *('--ros-args', '-p', 'tick_rate:=200', '-p', 'autostart:=false'),
        ],
        cwd=tmp_path_factory.mktemp('graph'),
        env=os.environ | {'ROS_DOMAIN_ID': str(domain)},
        stdin=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        with joined_graph('tester', 'endoscope', domain) as client:
            client.find(PATIENCE_S)
            client.wait_for(lambda: LOCK_STEP in client.health, 'the simulation clock', PATIENCE_S)
            yield process, client
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0


def test_a_machine_that_runs_nothing_for_a_second_is_no_fault(running):
    process, client = running
    client.ask_and_see('enable', PATIENCE_S)
    session = client.session
    process.send_signal(signal.SIGSTOP)
    time.sleep(1.0)
    process.send_signal(signal.SIGCONT)
    before_ns = client.heard_ns['supervisor']
    client.wait_for(
        lambda: client.heard_ns['supervisor'] > before_ns + 2_000_000_000,
        'the supervisor, twice',
        PATIENCE_S,
    )
    assert (client.state, client.session) == ('ENABLED', session)


def test_the_factor_is_told(running):
    _, client = running
    lines, values = status_of(client, PATIENCE_S)
    assert values['time']['simulated']
    assert 0.0 < values['time'][FACTOR] < 1.1
    [line] = [line for line in lines if line.startswith('time')]
    assert line.startswith('time         simulated, at ')
    assert float(client.health[LOCK_STEP].values[FACTOR]) == values['time'][FACTOR]
    at = next(k for k, line in enumerate(lines) if line.startswith('rig'))
    assert lines[at].startswith('rig          simulated (endoscope ')
    joints = load_rig(None).joints
    assert f'gear {joints.gear:g}, joints to {np.degrees(joints.reach):.0f} deg' in lines[at + 1]
    assert values['rig'][GEAR] == joints.gear


def test_what_was_not_heard_is_told_as_that_and_never_as_a_default():
    with joined_graph('tester', 'endoscope', private_domain()) as client:
        lines, values = status_of(client, 0.0)
    assert all('not heard' in line for line in lines if not line.startswith('state '))
    assert 'what forbids motion not heard' in lines[0]
    assert values['time'] == {'simulated': None, FACTOR: None}
    assert values['rig'] == {'kind': None}


def test_cells_that_fall_silent_are_a_fault_and_do_not_stop_time(running):
    _, client = running
    client.ask('enable', PATIENCE_S)
    set_parameters(client, 'load_cells', {'connected': False}, PATIENCE_S)
    try:
        client.wait_for(lambda: client.state == 'FAULT' and client.why, 'FAULT', PATIENCE_S)
        assert 'wires/measured_js has been silent' in client.why
        before_ns = client.heard_ns['supervisor']
        client.wait_for(
            lambda: client.heard_ns['supervisor'] > before_ns, 'the supervisor', PATIENCE_S
        )
    finally:
        set_parameters(client, 'load_cells', {'connected': True}, PATIENCE_S)


@pytest.mark.parametrize(
    ('words', 'simulated'),
    [
        ([], True),
        (['-p', 'device:=simulated'], True),
        (['-p', 'device:=dynamixel'], False),
        (['--params-file', 'cells.yaml'], False),
        (['-p', 'rig_file:=rig.yaml'], False),
        (['-p', 'rig_file:=rig.yaml', '-p', 'device:=simulated'], True),
        (['-p', 'use_sim_time:=false'], False),
    ],
)
def test_one_device_that_is_not_simulated_needs_real_time(tmp_path, monkeypatch, words, simulated):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'cells.yaml').write_text(_SECTION)
    (tmp_path / 'rig.yaml').write_text('devices: {tracker: aurora}\n')
    assert _is_simulated(words) is simulated
    assert not _is_simulated(words, real_time=True)


def _is_simulated(words, **options):
    """What time the first node is built with."""
    seen = []

    class Seen(Exception):
        """Enough was seen."""

    def add(factory):
        node = Node(
            'motor_driver',
            context=runtime.context,
            parameter_overrides=runtime.overrides_of('motor_driver'),
        )
        seen.append(node.get_parameter('use_sim_time').value)
        raise Seen

    with Runtime(['--ros-args', *words], Context(), private_domain()) as runtime:
        runtime.add = add
        with pytest.raises(Seen):
            compose(runtime, **options)
    return seen[0]


def test_two_rigs_of_a_domain_have_a_clock_each():
    clocks = []
    for words in ([], ['--ros-args', '-r', '__ns:=/left']):
        with Runtime(words, Context(), private_domain()) as runtime:
            runtime.keep_lock_step({'speed': 1.0})
            clocks.append(runtime.clock)
    assert clocks == ['/clock', 'clock']


def test_a_hand_that_falls_silent_in_slow_time_is_let_go_of_by_the_wall():
    with SimulatedGraph(
        overrides={'simulation_clock': {'speed': 0.5}, 'master': {'source': 'master'}}
    ) as graph:
        graph.enable()
        console = graph.nodes['master']
        hand = Handle(graph)
        while not console.motion.handle.engaged:
            hand.move(0.1, (0.2, 0.0))
        # 160 ms of a person's time, of which the slave has seen 80.
        hand.move(0.08, alive=False)
        assert not console.motion.handle.engaged
        while not console.motion.handle.engaged:
            hand.move(0.1, (0.2, 0.0))
