"""A hand that pushes a drawn rig into an obstacle, through the compensator and its guard."""

import pytest

from endoscope_lab.touch.push import judged
from endoscope_lab.touch.touched_rig import SIMULATORS


@pytest.mark.nightly
@pytest.mark.parametrize('simulator', SIMULATORS)
def test_the_guard_yields_to_a_push_and_holds_it_back(simulator):
    push = judged(simulator, 1)
    assert not push.early
    assert push.late < 0.3
    assert push.at_end <= push.guarded < 0.9 * push.without
