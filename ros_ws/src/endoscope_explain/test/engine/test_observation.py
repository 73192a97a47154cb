from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.physics.description import JointParameters, PlantDescription
from endoscope_explain.fit.model import packed_joint, residuals, simulate_joint
from endoscope_explain.observe.noise import fast_scatter, step_read
from endoscope_explain.observe.observation import observe, with_held_noise
from endoscope_explain.observe.predicted_signals import reading_lead, simulate_rig


@pytest.fixture(scope='module')
def recording(one_joint):
    return one_joint.record(one_joint.rig(), one_joint.motion())


def test_the_plant_itself_leaves_nothing_but_noise(recording, one_joint):
    (observation,) = observe(recording, one_joint.rig())
    outputs = simulate_joint(observation, *packed_joint(one_joint.rig(), 'bend_x'))
    left = residuals(observation, outputs)
    for channel, part in zip(observation.channels, observation.slices(), strict=True):
        size = np.sqrt(np.mean(left[part] ** 2))
        assert size < 1.1, channel.signal
        if channel.quantity in ('tension', 'bending'):
            assert size > 0.9, channel.signal


def test_a_late_reading_is_recognised_as_lead(recording, one_joint):
    (observation,) = observe(recording, one_joint.rig())
    outputs = simulate_joint(observation, *packed_joint(one_joint.rig(), 'bend_x'))
    motor = observation.channels[0]
    smooth = motor.time < 4.5
    now, next_tick = motor.predicted(outputs)[smooth], motor.predicted(outputs, 1.0)[smooth]
    assert np.allclose(now, motor.value[smooth], atol=2e-3)
    speed = np.gradient(now, motor.time[smooth])
    assert np.polyfit(1e-3 * speed, next_tick - now, 1)[0] == pytest.approx(1.0, rel=0.02)


def test_a_skewed_clock_moves_the_tracker_in_proportion_to_time(recording, one_joint):
    (observation,) = observe(recording, one_joint.rig())
    outputs = simulate_joint(observation, *packed_joint(one_joint.rig(), 'bend_x'))
    tracker = next(c for c in observation.channels if c.quantity == 'bending')
    late, on_time = tracker.predicted(outputs, 0.0, 0.01), tracker.predicted(outputs)
    smooth = tracker.time < 4.5
    expected = np.interp(tracker.time / 1.01, tracker.time, on_time)
    assert np.allclose(late[smooth], expected[smooth], atol=1e-2)
    assert np.abs(late - on_time)[smooth].max() > 0.02


def test_samples_marked_invalid_are_not_judged(recording, one_joint):
    valid = recording.bending.valid.copy()
    valid[100:140] = False
    marked = replace(recording, bending=replace(recording.bending, valid=valid))
    (observation,) = observe(marked, one_joint.rig())
    tracker = next(c for c in observation.channels if c.quantity == 'bending')
    assert len(tracker.time) == len(recording.bending.time) - 40
    assert not np.any((tracker.time > 2.501) & (tracker.time < 3.47))


def test_noise_worse_than_described_is_seen_in_holds(recording, one_joint):
    rng = np.random.default_rng(3)
    tension = recording.tension.values + 0.04 * rng.standard_normal(recording.tension.values.shape)
    noisy = replace(recording, tension=replace(recording.tension, values=tension))
    held = one_joint.record(one_joint.rig(), np.zeros(4000))
    for source, expected in ((noisy, np.sqrt(5.0)), (held, 1.0)):
        before = observe(source, one_joint.rig())
        after = with_held_noise(before)
        ratio = after[0].channels[2].noise.mean() / before[0].channels[2].noise.mean()
        assert ratio == pytest.approx(expected, rel=0.12)


def test_a_sensor_coarser_than_described_is_as_coarse_as_it_reads(recording, one_joint):
    step = 2.0 * np.pi / 512.0
    rounded = np.round(recording.shaft_position.values / step) * step
    coarse = replace(recording, shaft_position=replace(recording.shaft_position, values=rounded))
    fine, seen = (observe(source, one_joint.rig())[0] for source in (recording, coarse))
    assert seen.channels[0].noise == pytest.approx(step / np.sqrt(12.0))
    for before, after in zip(fine.channels[1:], seen.channels[1:], strict=True):
        assert np.array_equal(before.noise, after.noise), before.signal


def test_continuous_or_few_readings_are_on_no_grid():
    rng = np.random.default_rng(0)
    assert step_read(rng.standard_normal(1000)) == 0.0
    assert step_read(np.repeat([0.0, 0.5, 0.1], 300)) == 0.0
    rounded = 0.1 * np.round(np.cumsum(0.03 * rng.standard_normal(4000)) / 0.1)
    assert step_read(rounded.astype(np.float32)) == pytest.approx(0.1)


def test_scatter_is_found_where_the_wire_slips_and_only_there(one_joint):
    rng = np.random.default_rng(0)
    values = 0.02 * rng.standard_normal(4000)
    values[2000:3000] += 0.3 * rng.choice([-1.0, 1.0], 1000)
    scatter = fast_scatter(values, 0.02)
    assert np.all(scatter[:1700] == 0.0)
    assert np.all(scatter[2200:2800] > 0.1)


def test_when_readings_were_taken_is_told_by_the_motor_that_is_predicted_best(one_joint):
    known = PlantDescription(joints={'bend_x': JointParameters(), 'bend_y': JointParameters()})
    command = np.stack([one_joint.motion(), 0.5 * one_joint.motion()], axis=1)
    recording = one_joint.record(known, command)
    slower = replace(known.joints['bend_y'], motor_bandwidth=27.0)
    half = replace(known, joints={**known.joints, 'bend_y': slower})

    def lead(plant):
        observations = observe(recording, plant)
        return reading_lead(observations, simulate_rig(observations, plant))

    assert lead(half) == pytest.approx(lead(known), abs=0.02)
    assert lead(replace(half, joints={'bend_x': slower, 'bend_y': slower})) > lead(known) + 0.5
