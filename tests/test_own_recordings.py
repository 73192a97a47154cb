"""Recordings of the simulated slave through the live graph, explained with its own plant."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_bags import open_bag
from endoscope_bags.copying import cut
from endoscope_bringup.demo.live_graph import LiveGraph
from endoscope_core.physics import PlantDescription
from endoscope_core.rig import shipped_rig
from endoscope_explain.audit import audit_recording
from endoscope_explain.case import Sources
from endoscope_explain.explanation import Verdict
from endoscope_explain.many_bags import explained_case
from endoscope_explain.observe.predicted_signals import view
from endoscope_explain.recording import SETPOINT, recording_from_bag
from endoscope_nodes.runtime.private_domain import private_domain

pytestmark = pytest.mark.engine

PLANT = PlantDescription()


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    """Motions that end before their end, a pause in one, rests, and the slave disabled once."""
    bag = tmp_path_factory.mktemp('own') / 'bag'
    overrides = {'motor_driver': {'seed': 3}}
    with LiveGraph(bag, private_domain(), lock_step=True, overrides=overrides, rate=250) as graph:
        graph.client.ask('enable')
        graph.set('master', source='motion', motion='periodic')
        graph.advance(4.3)
        graph.set('master', source='none')
        graph.advance(1.0)
        graph.set('master', source='motion', motion='non_periodic')
        graph.advance(1.9)
        graph.client.ask('pause')
        graph.advance(0.5)
        graph.client.ask('resume')
        graph.advance(1.5)
        graph.set('master', source='none')
        graph.advance(1.0)
        graph.client.ask('disable')
        graph.advance(0.4)
        graph.client.ask('enable')
        graph.set('master', source='motion', motion='periodic')
        graph.advance(2.0)
        graph.stop()
    return bag


@pytest.fixture(
    scope='module', params=[(0.0, None), pytest.param((2.1, None), marks=pytest.mark.nightly)]
)
def stretch(request, recorded, tmp_path_factory):
    out = tmp_path_factory.mktemp('cut') / 'cut'
    cut(recorded, out, *request.param)
    return out


@pytest.fixture(scope='module')
def of_another_rig(tmp_path_factory):
    """Motions of a rig with another gear, slower motors and less patience, with a pause in one."""
    shipped = shipped_rig()
    rig = replace(
        shipped,
        joints=replace(shipped.joints, gear=0.6, drive=2.5),
        motors=replace(shipped.motors, speed=2.5, acceleration=150.0),
        timeouts=replace(shipped.timeouts, command=0.04),
    )
    bag = tmp_path_factory.mktemp('other') / 'bag'
    with LiveGraph(bag, private_domain(), lock_step=True, overrides={}, rate=250, rig=rig) as graph:
        graph.client.ask('enable')
        graph.set('master', source='motion', motion='periodic')
        graph.advance(2.2)
        graph.set('master', source='none')
        graph.advance(1.0)
        graph.set('master', source='motion', motion='non_periodic')
        graph.advance(2.0)
        graph.stop()
    return bag, rig


def test_limits_and_gear_are_those_of_the_rig_that_was_recorded(of_another_rig):
    bag, rig = of_another_rig
    assert recording_from_bag(bag, PLANT).rig == rig
    assert_as_described(bag)


def test_what_is_simulated_is_what_was_in_force(stretch):
    assert_as_described(stretch)


def assert_as_described(bag):
    recording = recording_from_bag(bag, PLANT)
    assert recording.command.topic == SETPOINT
    audit = audit_recording(recording, PLANT)
    assert audit.faults() == ()
    seen = view(audit.recording, {'described': PLANT})
    misfit = {
        name: float(np.sqrt(np.mean(signal.residual('described') ** 2)))
        for name, signal in seen.signals.items()
    }
    assert max(misfit.values()) < 1.15, misfit
    # All that is judged is as the plant says, not only on average.
    worst = max(float(np.abs(s.residual('described')).max()) for s in seen.signals.values())
    assert worst < 6.0


def test_a_motion_cut_out_of_a_session_is_consistent(recorded, tmp_path):
    cut(recorded, tmp_path / 'cut', 5.5, 11.0)
    case = explained_case(Sources(tmp_path / 'cut', PLANT, quick=True, jobs=1))
    assert case.verdict is Verdict.CONSISTENT
    assert case.effects == ()


def test_a_stop_is_replayed_as_the_driver_made_it(tmp_path):
    """Silent load cells end the session in the tick of a command, which is obeyed no more."""
    bag = tmp_path / 'bag'
    with LiveGraph(bag, private_domain(), lock_step=True, overrides={}, rate=250) as graph:
        graph.client.ask('enable')
        graph.set('master', source='motion', motion='periodic')
        graph.advance(1.5)
        graph.set('load_cells', connected=False)
        graph.client.wait_for(lambda: graph.client.state == 'FAULT', 'FAULT')
        graph.set('master', source='none')
        graph.set('load_cells', connected=True)
        stopped = graph.now()
        graph.advance(1.5)
        graph.stop()
    begin = stopped - open_bag(bag).start_ns * 1e-9
    recording = audit_recording(recording_from_bag(bag, PLANT), PLANT).recording
    for name, signal in view(recording, {'described': PLANT}).signals.items():
        after = signal.residual('described')[signal.time > begin]
        # An encoder that stands still is off by the same part of a count all the time.
        if not name.startswith('motor/measured_js') or name.endswith('effort'):
            assert np.sqrt(np.mean(after**2)) < 1.3, name
