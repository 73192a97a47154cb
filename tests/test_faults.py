"""Nodes as processes that die or stall, and second senders: nothing moves but on an enable.

`endoscope bench faults` tries the other rows, and each of them often; see doc/how_well_it_works.md.
"""

from random import Random

import pytest

from endoscope_core.rig import load_rig
from endoscope_lab.faults.process_faults import PROCESS_FAULTS, undergo
from endoscope_lab.faults.process_rig import ProcessRig
from endoscope_lab.faults.trace import HELD_S, STILL

RATE_HZ = 250


@pytest.fixture(scope='module')
def rig(tmp_path_factory):
    with ProcessRig(RATE_HZ, False, tmp_path_factory.mktemp('faults'), Random(1)) as rig:
        yield rig


@pytest.mark.parametrize(
    ('name', 'state'),
    [
        ('supervisor killed', 'DISABLED'),
        ('master killed', 'FAULT'),
        ('motor_driver stalled for 0.2 s', 'FAULT'),
        *(
            pytest.param(*row, marks=pytest.mark.nightly)
            for row in (
                ('compensator killed', 'FAULT'),
                ('master stalled for 2 s', 'FAULT'),
                ('competing publisher on slave/servo_jp', 'FAULT'),
                ('clutch released and pressed within 0.6 s', None),
                ('commands 0.12 to 0.5 s late, outside program', 'FAULT'),
            )
        ),
    ],
)
def test_nothing_moves_but_on_an_enable(rig, name, state):
    outcome = undergo(PROCESS_FAULTS[name], rig)
    assert state is None or outcome.state == state, outcome
    assert outcome.unasked <= STILL, outcome
    assert outcome.goal_share <= 1.001, outcome
    # The measured pose of another stream is no reason to hurry.
    assert outcome.shaft_speed < 0.5 * load_rig().motors.speed, outcome
    assert outcome.enabled_s is not None, outcome
    if name == 'supervisor killed':
        assert outcome.still_s is not None
        assert outcome.still_s < HELD_S + outcome.gap_s, outcome
