"""Other people's methods on the benchmark's cases."""

import importlib.util

import numpy as np
import pytest

from endoscope_core.errors import EndoscopeError
from endoscope_lab.concealed.strata import drawn_case
from endoscope_lab.peers.library import terms_of
from endoscope_lab.peers.problem import PERIOD_S, predicts, problem_of
from endoscope_lab.peers.regions import Overlap, changed_windows, pooled, windows_in
from endoscope_lab.peers.symbolic import OF_PLANT, OF_SENSOR, named_by
from endoscope_lab.peers.trial import PEERS, example, require_installed


@pytest.fixture(scope='module')
def case():
    """A load cell that drifts."""
    case = drawn_case('mixed_forms', 9)
    assert case.laws[0].name == 'load_cell_pos_of_time'
    return case


@pytest.fixture(scope='module')
def problem(case):
    return problem_of(case)


def test_every_name_is_an_effect_or_a_place(problem):
    for name in {*OF_PLANT.values(), *OF_SENSOR.values(), *(t.name for t in terms_of(problem))}:
        assert problem.says(name).stage


def test_the_cell_that_drifts_is_to_blame(problem):
    def of_time(states, target, _):
        found = np.polynomial.Polynomial.fit(states[:, 0], target, 8)
        return lambda x: found(x[:, 0])

    assert named_by(of_time, problem).name == 'load_cell_pos_of_time'


def test_noise_is_not_predicted():
    draw, time = np.random.default_rng(1), PERIOD_S * np.arange(1000)
    noise = draw.standard_normal(1000)
    assert not predicts(time, noise**2, (noise - 0.1 * draw.standard_normal(1000)) ** 2)
    assert predicts(time, (noise + np.sin(time)) ** 2, noise**2)


@pytest.mark.parametrize('peer', [name for name in PEERS if not PEERS[name][0]])
def test_a_peer_that_is_written_here_works_on_its_own_example(peer):
    assert example(peer).works


@pytest.mark.skipif(importlib.util.find_spec('mujoco') is None, reason='peers are not installed')
def test_mujoco_finds_the_numbers_of_its_own_example():
    assert example('mujoco.sysid').works


def test_regions_are_judged_by_the_windows_that_they_share():
    true = windows_in([(1.0, 2.0)], 4.0)
    assert np.flatnonzero(true).tolist() == [4, 5, 6, 7]
    half = Overlap.of(windows_in([(1.5, 2.5)], 4.0), true)
    assert half == Overlap(hits=2, extra=2, missed=2, all=16)
    assert half.f1 == pytest.approx(0.5)
    assert half.f1_of_all == pytest.approx(0.4)
    silent = Overlap.of(windows_in([], 4.0), windows_in([], 4.0))
    assert silent.f1 == 1.0
    # A false region where nothing is concealed lowers what is found elsewhere.
    alarm = Overlap.of(windows_in([(0.0, 1.0)], 4.0), windows_in([], 4.0))
    assert pooled([half, silent, alarm]).f1 == pytest.approx(0.4 / 1.2)


def test_a_law_changes_windows_and_a_rig_without_one_none(case):
    assert 0.5 < changed_windows(case).mean() <= 1.0
    assert not changed_windows(drawn_case('nulls', 4)).any()


@pytest.mark.skipif(importlib.util.find_spec('pyoperon') is not None, reason='peers are installed')
def test_what_is_missing_is_said_in_one_line():
    with pytest.raises(
        EndoscopeError, match=r'^pyoperon not installed: run `make -C ros_ws peers`'
    ):
        require_installed(['forward selection', 'Operon'])
