"""Real recordings as `explain` takes them; skipped if they are not available."""

import numpy as np
import pytest
from outside_data import REAL, needs

from endoscope_core.physics.simulator import simulate
from endoscope_core.rig import shipped_rig
from endoscope_lab.papers.real_recordings import recordings_folder
from endoscope_lab.real.pieces import late_cells
from endoscope_lab.real.rig import PLANT, JudgedTake, Plant, as_described, wide
from endoscope_lab.real.takes import KGF, Take, between_cycles, read

FOLDER = recordings_folder()
recorded = needs(REAL)


@pytest.fixture(scope='module')
def simulated():
    """A take of the described plant itself."""
    time = np.arange(12_000) * 1e-3
    command = np.sin(2.0 * np.pi / 5.0 * time)
    answer = simulate(PLANT, shipped_rig().joints.gear * command[:, None])
    seen = slice(None, None, 25)
    return Take(
        'simulated',
        5.0,
        time,
        command,
        answer.time[seen],
        answer.bending[seen, 0],
        answer.tension[seen, 0],
        0.0,
    )


def test_the_described_plant_leaves_next_to_nothing_of_its_own_recording(simulated):
    observation = simulated.observation()
    model = wide(observation)
    judged = JudgedTake(simulated, 5.0, {'nominal': Plant(model, as_described(model))})
    angle, first, second = judged.left('nominal')
    assert np.rad2deg(angle) < 0.1
    assert max(first, second) < 0.03


def test_a_refit_finds_a_number_that_was_changed(simulated):
    model = wide(simulated.until(5.0).observation())
    k = next(k for k, item in enumerate(model.free) if item.name == 'joint_radius')
    start = as_described(model)
    start[k] += 0.1
    found = Plant(model, start).refitted()
    assert found.model.free[k].value(found.theta[k]) == pytest.approx(8e-4, rel=0.02)


def test_cycles_of_one_motion_are_alike_and_others_are_not_compared(simulated):
    angle, *tensions = between_cycles(simulated)
    assert np.rad2deg(angle) < 0.05
    assert max(tensions) < 0.02
    other = Take(**{**vars(simulated), 'cycle_s': 3.0})
    assert np.isnan(between_cycles(other)).all()


@recorded
def test_recordings_have_real_time_and_units():
    tube, state, sent = (read(FOLDER / f'{n}.txt') for n in ('0', 'conf0_60', 'ff'))
    assert tube.cycle_s == pytest.approx(5.72, abs=0.01)
    assert tube.tension[0] == pytest.approx(5.0, abs=0.05)
    assert state.cycle_s == pytest.approx(13.66, abs=0.01)
    assert state.tension[0] == pytest.approx(0.28 * KGF, abs=0.1)
    standing = np.flatnonzero(np.diff(state.command))[-1]
    assert state.time[-1] - state.time[standing] == pytest.approx(3.06, abs=0.05)
    assert np.rad2deg(sent.command.max()) == pytest.approx(70.1, abs=0.1)
    assert sent.tension is None


@recorded
def test_both_cells_of_a_tube_read_late_by_a_delay():
    first, second = late_cells(FOLDER, 1, lambda _: None, ('0',))
    assert (first.cell, second.cell) == ('_pos', '_neg')
    assert 0.04 < second.delay_s < 0.12
    assert 0.04 < first.delay_s < 0.12
    assert min(first.for_delay, second.for_delay) > 0.0
