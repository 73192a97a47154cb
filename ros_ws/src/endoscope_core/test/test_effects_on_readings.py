"""Known answers of each sensing effect, and of clocks and recorder."""

import numpy as np
import pytest

from endoscope_core.effects import recording_gap
from endoscope_core.plant import (
    EffectSpec,
    PlantDescription,
    RecordingFaults,
    load_plant,
    recording_faults,
    simulate,
)
from endoscope_core.plant.on_stamps import AnswerStamps, answer_commands
from endoscope_core.plant.plant_file import PlantFileError
from endoscope_core.plant.recording import TOPICS

TIME = 1e-3 * np.arange(3000)
COMMAND = 0.5 * np.deg2rad(70.0) * np.column_stack([np.sin(2.0 * TIME), np.sin(3.0 * TIME)])
NOMINAL = PlantDescription()


def plant_with(effect_id, joint='bend_x', **parameters):
    return PlantDescription(effects=(EffectSpec(effect_id, joint, parameters),))


@pytest.fixture(scope='module')
def true():
    return simulate(NOMINAL, COMMAND)


def bending_with(effect_id, **parameters):
    trajectory = simulate(plant_with(effect_id, **parameters), COMMAND)
    return trajectory.bending[:, 0]


def test_tracker_bias_drift_and_distortion_are_their_formulas(true):
    q = true.bending_true[:, 0]
    np.testing.assert_allclose(bending_with('tracker_bias', bias_rad=0.1), q + 0.1)
    np.testing.assert_allclose(bending_with('tracker_drift', rate_rad_per_s=0.02), q + 0.02 * TIME)
    np.testing.assert_allclose(
        bending_with('tracker_distortion', linear=0.1, quadratic=0.2, cubic=-0.3),
        q + 0.1 * q + 0.2 * q**2 - 0.3 * q**3,
    )


@pytest.mark.parametrize('delay', [0.0, 0.04, 0.0405, 0.5])
def test_tracker_delay_reads_the_angle_of_the_past(true, delay):
    past = np.interp(TIME - delay, TIME, true.bending_true[:, 0])
    np.testing.assert_allclose(bending_with('tracker_delay', delay_s=delay), past, atol=1e-12)


def test_tracker_delay_leaves_the_true_angle_alone(true):
    late = simulate(plant_with('tracker_delay', delay_s=0.1), COMMAND)
    np.testing.assert_array_equal(late.bending_true, true.bending_true)


@pytest.mark.parametrize('wire', [0, 1])
@pytest.mark.parametrize(
    ('effect_id', 'parameters', 'reading'),
    [
        ('load_cell_drift', {'rate_n_per_s': 0.3}, lambda own, other: own + 0.3 * TIME),
        ('load_cell_gain', {'gain': 1.2}, lambda own, other: 1.2 * own),
        ('load_cell_crosstalk', {'share': 0.15}, lambda own, other: own + 0.15 * other),
        ('load_cell_saturation', {'limit_n': 6.0}, lambda own, other: np.minimum(own, 6.0)),
    ],
)
def test_a_load_cell_fault_is_in_its_cell_only(true, wire, effect_id, parameters, reading):
    faulty = simulate(plant_with(effect_id, wire=float(wire), **parameters), COMMAND)
    own, other = true.tension[:, 0, wire], true.tension[:, 0, 1 - wire]
    np.testing.assert_allclose(faulty.tension[:, 0, wire], reading(own, other), atol=1e-12)
    np.testing.assert_array_equal(faulty.tension[:, 0, 1 - wire], other)
    np.testing.assert_array_equal(faulty.shaft_effort, true.shaft_effort)


def test_a_plant_without_faults_has_a_faithful_recording():
    faults = recording_faults(NOMINAL)
    assert faults == RecordingFaults()
    np.testing.assert_array_equal(faults.tracker_stamp(TIME), TIME)
    assert faults.keeps('wires', TIME).all()
    np.testing.assert_array_equal(faults.spoilt(COMMAND, TIME), COMMAND)


def test_a_skewed_clock_is_fast_by_its_skew_and_back():
    faults = recording_faults(plant_with('clock_skew', skew=0.002))
    assert faults.tracker_stamp(10.0) == pytest.approx(10.02)
    np.testing.assert_allclose(faults.tracker_time(faults.tracker_stamp(TIME)), TIME, atol=1e-12)


def test_the_tracker_has_one_clock():
    both = tuple(
        EffectSpec('clock_skew', joint, {'skew': skew})
        for joint, skew in (('bend_x', 1e-3), ('bend_y', 2e-3))
    )
    with pytest.raises(ValueError, match='one clock'):
        recording_faults(PlantDescription(effects=both))


@pytest.mark.parametrize('topic', [0, 1, 2])
def test_a_gap_is_in_its_topic_only(topic):
    faults = recording_faults(
        plant_with('recording_gap', time_s=1.0, duration_s=0.5, topic=float(topic))
    )
    kept = faults.keeps(TOPICS[topic], TIME)
    np.testing.assert_array_equal(kept, (TIME < 1.0) | (TIME >= 1.5))
    for other in set(TOPICS) - {TOPICS[topic]}:
        assert faults.keeps(other, TIME).all()
    with pytest.raises(ValueError, match='valid are motor, wires, tracker'):
        faults.keeps('wire', TIME)


def test_the_topics_of_a_gap_are_the_choices_of_its_parameter():
    assert recording_gap.DEFINITION.parameters[2].choices == tuple(map(float, range(len(TOPICS))))


def test_outliers_have_their_rate_and_size_in_their_joint():
    faults = recording_faults(plant_with('tracker_outliers', 'bend_y', rate=0.05, size_rad=0.3))
    time = 0.025 * np.arange(40000)
    wrong = faults.spoilt(np.zeros((40000, 2)), time)
    np.testing.assert_array_equal(wrong[:, 0], 0.0)
    assert np.mean(wrong[:, 1] != 0.0) == pytest.approx(0.05, abs=0.005)
    assert set(np.unique(wrong[:, 1])) == {-0.3, 0.0, 0.3}
    assert np.mean(wrong[:, 1]) == pytest.approx(0.0, abs=0.005)


def test_outliers_depend_on_seed_and_time_alone():
    faults = recording_faults(plant_with('tracker_outliers', rate=0.2, size_rad=0.3))
    time = 0.025 * np.arange(400)
    at_once = faults.spoilt(np.zeros((400, 2)), time, seed=4)
    one_by_one = [faults.spoilt(np.zeros(2), t, seed=4) for t in time]
    np.testing.assert_array_equal(at_once, one_by_one)
    assert not np.array_equal(at_once, faults.spoilt(np.zeros((400, 2)), time, seed=5))


@pytest.mark.parametrize('skew', [0.01, -0.01])
def test_recorded_stamps_are_answered_by_the_clock_that_made_them(true, skew):
    stamps = np.arange(3000) * 1_000_000
    tracker = stamps[::25]
    answer = answer_commands(
        plant_with('clock_skew', skew=skew), stamps, COMMAND, AnswerStamps(stamps, stamps, tracker)
    )
    known = tracker * 1e-9 / (1.0 + skew) < TIME[-1]
    expected = np.interp(tracker * 1e-9 / (1.0 + skew), TIME, true.bending[:, 0])
    np.testing.assert_allclose(answer.bending[known, 0], expected[known], atol=1e-6)


def test_recorded_stamps_are_answered_with_outliers(true):
    stamps = np.arange(3000) * 1_000_000
    answer = answer_commands(
        plant_with('tracker_outliers', rate=0.2, size_rad=0.3),
        stamps,
        COMMAND,
        AnswerStamps(stamps, stamps, stamps[::25]),
    )
    off = np.abs(answer.bending[:, 0] - true.bending[::25, 0])
    assert set(np.round(off, 6)) == {0.0, 0.3}


def test_a_plant_file_with_two_clocks_is_refused(tmp_path):
    path = tmp_path / 'plant.yaml'
    path.write_text(
        'effects:\n'
        '  - {id: clock_skew, joint: bend_x, parameters: {skew: 0.001}}\n'
        '  - {id: clock_skew, joint: bend_y, parameters: {skew: 0.002}}\n'
    )
    with pytest.raises(PlantFileError, match='one clock'):
        load_plant(path)
