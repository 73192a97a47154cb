"""Motors and master fail in the running graph, over a terminal; see doc/how_well_it_works.md."""

import re

import pytest
from std_srvs.srv import Trigger

from endoscope_lab.faults.motor_faults import MOTOR_FAULTS, undergo
from endoscope_lab.faults.motor_rig import MotorRig
from endoscope_nodes.runtime.private_domain import private_domain

# The bench tries the others too.
FAULTS = (
    'adapter out',
    *(
        pytest.param(name, marks=pytest.mark.nightly)
        for name in (
            'disturbed',
            'overload',
            'restart',
            'node hangs',
            'over-tension',
            'master killed',
            'motor driver killed',
        )
    ),
)


STALL = 'stood still for'
"""A node that a busy machine did not run for 0.1 s ends the session by itself, and says this."""
# A servo that a busy machine lets answer late must not look like one that is gone.
PATIENCE_S = 1.0


def undisturbed(fault, folder):
    """What followed a fault; tried again where the machine stalled before the fault was found."""
    for trial in range(20):
        own = folder / str(trial)
        own.mkdir()
        outcome = undergo(fault, own, 0.4, PATIENCE_S, private_domain())
        if STALL not in outcome.cause or fault is MOTOR_FAULTS['node hangs']:
            return outcome
    return pytest.fail(f'the machine stalls all the time: {outcome}')


@pytest.mark.parametrize('name', FAULTS)
def test_what_the_slave_makes_of(name, tmp_path):
    fault = MOTOR_FAULTS[name]
    outcome = undisturbed(fault, tmp_path)
    assert outcome.state == fault.ends_in, outcome
    assert re.search(fault.cause, outcome.cause), outcome
    assert (outcome.faults_in_bag > 0) == (fault.ends_in == 'FAULT')
    assert (outcome.stopped_s is not None) == fault.stops
    assert outcome.largest_error < 0.03


def stalled(rig):
    return STALL in rig.node('supervisor').machine.cause


def shafts_move(rig):
    held = rig.shafts[-1][1].position

    def moved():
        # A busy machine's stall may end the session again.
        if rig.state != 'ENABLED':
            rig.order('enable')
        return abs(rig.shafts[-1][1].position[0] - held[0]) > 0.02

    return rig.wait(moved)


def shafts_stand_still(rig):
    count = len(rig.shafts)
    assert rig.wait(lambda: len(rig.shafts) > count + 100)
    track = [s.position[0] for _, s in rig.shafts[-50:]]
    return max(track) - min(track) < 2e-3


@pytest.mark.nightly
def test_after_a_fault_nothing_moves_before_enable_is_given(tmp_path):
    with MotorRig(tmp_path, patience=PATIENCE_S, domain=private_domain()) as rig:
        rig.enable_and_move()
        rig.emulator.do('silence', 1)
        # In other words once it is set up again in vain.
        silent = re.compile('servo 1 (on .*)?does not answer')
        assert rig.wait(lambda: silent.search(rig.last_message('/endoscope/motor_driver: device')))
        assert rig.wait(lambda: rig.state == 'FAULT')
        rig.order('enable')
        assert rig.wait(lambda: 'not enabled' in rig.node('supervisor')._refused.reason)
        rig.emulator.do('silence')
        assert shafts_stand_still(rig)
        assert rig.state == 'FAULT'
        rig.enable_and_move()
        assert shafts_move(rig), (rig.state, rig.node('supervisor').machine.cause)


def test_holding_letting_go_and_restarting(tmp_path):
    with MotorRig(tmp_path, patience=PATIENCE_S, domain=private_domain()) as rig:
        reboot = rig.probe.create_client(Trigger, 'motor/reboot')

        def asked():
            answer = reboot.call_async(Trigger.Request())
            assert rig.wait(answer.done)
            return answer.result().success

        rig.enable_and_move()
        while asked():
            assert stalled(rig), 'a servo that holds the slave is not restarted'
            rig.enable_and_move()

        def pauses():
            if rig.state == 'ENABLED':
                rig.order('pause')
            elif stalled(rig):
                rig.order('enable')
            return rig.state == 'PAUSED'

        assert rig.wait(pauses)
        assert shafts_stand_still(rig)
        assert rig.emulator.state(1)['torque'] == 1
        rig.order('disable')
        assert rig.wait(lambda: rig.emulator.state(1)['torque'] == 0)
        rig.enable_and_move()
        rig.emulator.do('overload', 2)
        assert rig.wait(lambda: rig.state == 'FAULT')
        assert asked()
        assert rig.wait(lambda: rig.emulator.state(2)['hardware'] == 0)
        rig.enable_and_move()
        assert shafts_move(rig)
