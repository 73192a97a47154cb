"""What counts as motion that was made before, and what is held out to judge."""

import numpy as np
import pytest

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.layout import IN_COMMAND
from endoscope_explain.observe.observation import observe
from endoscope_explain.observe.revisits import GAP_S, held_out, motion_repeats, seen_before, strokes

TIME = 1e-3 * np.arange(40_000)
CYCLE = 2.0 * np.pi


@pytest.mark.parametrize(
    ('command', 'share'),
    [
        (np.sin(TIME[:6283]), 0.0),
        (np.sin(TIME[:9000]), 1.0 - 1.25 * CYCLE / 9.0),
        (np.sin(TIME), 1.0 - 1.25 * CYCLE / 40.0),
        (0.02 * TIME, 0.0),
        (np.zeros(9000), 8.0 / 9.0),
        (np.where(TIME < 20.0, 0.5, 0.0), 38.0 / 40.0),
    ],
    ids=['one cycle', 'the calibration', 'many cycles', 'ramp', 'rest', 'holds'],
)
def test_share_of_the_motion_that_was_made_before(command, share):
    assert np.mean(seen_before(command)) == pytest.approx(share, abs=0.06)


def test_a_rise_from_another_turn_is_another_branch():
    # The first rise begins at rest, the second one at the far end of the loop.
    seen = seen_before(np.sin(TIME[:12566]))
    assert not seen[: round(1.2 * CYCLE / 0.02)].any()
    assert seen[round(1.3 * CYCLE / 0.02) :].mean() > 0.9


def test_the_share_does_not_depend_on_the_tick():
    command = np.sin(TIME[:9000])
    coarse = np.mean(seen_before(command[::5], 5e-3))
    assert coarse == pytest.approx(np.mean(seen_before(command)), abs=0.02)


def observation(one_joint, command):
    recording = one_joint.record(one_joint.rig(), command)
    (seen,) = observe(recording, PlantDescription().of_joints(('bend_x',)))
    return seen


def test_of_two_cycles_the_second_one_is_judged_by_the_first(one_joint):
    seen = observation(one_joint, np.sin(TIME[:12566]))
    fitted, judged = held_out(seen)
    time = seen.times
    assert motion_repeats(seen)
    assert not (fitted & judged).any()
    assert time[judged].min() > 1.1 * CYCLE
    assert judged.mean() == pytest.approx(0.37, abs=0.06)
    apart = np.abs(time[judged][:, None] - time[fitted][None, ::7])
    assert apart.min() > 0.8 * GAP_S


def test_of_a_motion_that_is_never_made_again_blocks_are_judged(one_joint):
    seen = observation(one_joint, 0.04 * TIME[:30000] * np.sin(TIME[:30000]))
    fitted, judged = held_out(seen)
    assert not (fitted & judged).any()
    assert judged.mean() == pytest.approx(0.25, abs=0.05)


def test_strokes_say_which_of_them_were_made_twice(one_joint):
    seen = observation(one_joint, np.sin(TIME[:12566]))
    made = strokes(seen.inputs[0, :, IN_COMMAND], seen.tick)
    assert [round(each.end, 1) for each in made] == [0.5, -0.5, 0.5, -0.5, 0.0]
    # The first one begins where no other does; both falls are the same.
    assert [made[k].twice for k in (0, 1, 3)] == [False, True, True]
