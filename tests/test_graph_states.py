"""Operating states of the running graph."""

import numpy as np
import pytest
from simulated_graph import SimulatedGraph
from std_msgs.msg import String

from endoscope_nodes.names import OPERATING_STATE
from endoscope_nodes.qos import RESULT

# In real time, on a machine that may stall for longer than a device may be silent.
pytestmark = pytest.mark.flaky(reruns=2)

MOTORS = ('motor_x', 'motor_y')


def test_pause_holds_and_resume_goes_on_without_a_jump():
    with SimulatedGraph() as graph:
        graph.enable()
        graph.set('console', source='motion')
        graph.advance(2.0)
        assert graph.command('pause') == 'PAUSED'
        drives = graph.listen('motor/servo_jp', MOTORS)
        shafts = graph.listen('motor/measured_js', MOTORS)
        graph.advance(1.0)
        assert drives == []
        assert np.ptp([s.position for s in shafts[300:]], axis=0).max() < 0.004
        assert graph.command('resume') == 'ENABLED'
        graph.advance(0.5)
        assert len(drives) > 490
        steps = np.abs(np.diff([s.position for s in shafts], axis=0))
        assert steps.max() < 0.01


def test_over_tension_is_a_fault_that_latches():
    with SimulatedGraph(overrides={'supervisor': {'tension_ceiling': 8.0}}) as graph:
        graph.enable()
        graph.set('console', source='motion')
        graph.advance(2.5)
        assert graph.states[-1] == 'FAULT'
        assert 'over the ceiling' in graph.nodes['supervisor'].machine.cause
        drives = graph.listen('motor/servo_jp', MOTORS)
        assert graph.command('enable') == 'FAULT'
        graph.advance(0.5)
        assert drives == []
        assert graph.diagnostics['supervisor: operating state'][-1].level == b'\x02'


def test_silent_load_cells_are_a_fault_until_they_speak_and_enable_is_given():
    overrides = {'conductor': {'wait_for': ['motor/measured_js']}}
    with SimulatedGraph(overrides=overrides) as graph:
        graph.enable()
        graph.set('load_cells', connected=False)
        graph.advance(0.5)
        assert graph.states[-1] == 'FAULT'
        assert graph.command('enable') == 'FAULT'
        graph.set('load_cells', connected=True)
        graph.advance(0.5)
        assert graph.states[-1] == 'FAULT'
        assert graph.command('enable') == 'ENABLED'


def test_enabling_waits_for_the_slave():
    with SimulatedGraph() as graph:
        assert graph.command('enable') == 'DISABLED'
        graph.advance(0.2)
        assert graph.command('enable') == 'ENABLED'


def test_commands_out_of_place_change_nothing():
    with SimulatedGraph() as graph:
        graph.advance(0.1)
        assert graph.command('resume') == 'DISABLED'
        assert graph.command('fly') == 'DISABLED'
        graph.advance(1.1)
        assert 'fly' in graph.reported('supervisor: operating state')['last refusal']


def test_a_silent_supervisor_stops_the_motion():
    with SimulatedGraph() as graph:
        graph.enable()
        graph.set('console', source='motion')
        graph.advance(0.5)
        graph.kill('supervisor')
        drives = graph.listen('motor/servo_jp', MOTORS)
        graph.advance(5.0)
        assert 2000 < len(drives) < 4000


def test_a_supervisor_that_comes_back_does_not_re_enable():
    with SimulatedGraph() as graph:
        graph.enable()
        graph.set('console', source='motion')
        graph.advance(0.5)
        graph.kill('supervisor')
        graph.advance(4.0)
        supervisor = graph.speak(String, OPERATING_STATE, RESULT)
        shafts = graph.listen('motor/measured_js', MOTORS)

        def moved_after(*states):
            shafts.clear()
            for state in states:
                supervisor.publish(String(data=state))
                graph.advance(1.0)
            return np.ptp([s.position for s in shafts], axis=0).max() > 0.05

        assert not moved_after('ENABLED', 'ENABLED')
        assert graph.diagnostics['motor_driver: device'][-1].level == b'\x02'
        assert moved_after('DISABLED', 'ENABLED')
        assert graph.diagnostics['motor_driver: device'][-1].level == b'\x00'
