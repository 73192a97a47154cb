import numpy as np
import pytest

from endoscope_core.calibration import BendingRecord, CalibrationRun, CalibrationStep
from endoscope_core.signals import BRIEF, calibration_motion, calibration_sinusoid

MS = 1_000_000


def commands_of(run, periods=1):
    stamp, out, steps = 1000 * MS, [], []
    while True:
        step = run.step
        command = run.command(stamp, periods)
        if command is None:
            return np.array(out), steps
        out.append([stamp * 1e-9, *command.position, *command.velocity])
        steps.append(step)
        stamp += periods * MS


def test_returns_rests_and_moves_without_a_jump():
    run = CalibrationRun((0.4, -1.0), 4, MS, return_speed=1.0, rest=0.5)
    table, steps = commands_of(run)
    assert list(dict.fromkeys(steps)) == [
        CalibrationStep.RETURNING,
        CalibrationStep.RESTING,
        CalibrationStep.MOVING,
    ]
    assert run.step is CalibrationStep.DONE
    np.testing.assert_allclose(table[0, 1:3], (0.4, -1.0))
    steps_taken = np.abs(np.diff(table[:, 1:3], axis=0)) / 1e-3
    returning = steps.count(CalibrationStep.RETURNING)
    assert steps_taken[: returning - 1].max() <= 1.0 + 1e-6
    assert steps_taken.max() < 6.0
    np.testing.assert_allclose(table[-1, 1:], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.gradient(table[:, 1], 1e-3)[5:-5], table[5:-5, 3], atol=0.05)


@pytest.mark.parametrize('periods', [1, 3, 4, 5, 10, 20])
def test_any_beat_commands_the_sinusoid_to_its_very_end(periods):
    run = CalibrationRun((0.4, -1.0), 4, MS, 1.0, 0.5)
    table, steps = commands_of(run, periods)
    moving = steps.index(CalibrationStep.MOVING)
    into = table[moving:-1, 0] - run.record.start_ns * 1e-9
    np.testing.assert_allclose(table[moving:-1, 1], calibration_sinusoid()(into)[0], atol=1e-9)
    np.testing.assert_array_equal(table[-1, 1:], run._rows[-1])


def test_a_brief_calibration_from_rest_ends_within_five_seconds():
    motion = calibration_motion(BRIEF)
    run = CalibrationRun((0.0, 0.0), 4, MS, return_speed=1.0, rest=0.5, motion=motion)
    table, _ = commands_of(run)
    assert table[-1, 0] - table[0, 0] < 5.0
    np.testing.assert_allclose(table[-1, 1:], 0.0, atol=1e-6)
    for k in range(motion.samples):
        run.add_tension(run.record.start_ns + k * MS, (1.0, 2.0, 3.0, 4.0))
    assert run.record.complete
    assert run.record.resampled().shape == (motion.samples, 4)


def test_homing_ends_at_zero():
    run = CalibrationRun((0.5, 0.2), 4, MS, 1.0, 0.1, homing=True)
    table, steps = commands_of(run)
    assert CalibrationStep.MOVING not in steps
    assert run.record is None
    np.testing.assert_allclose(table[-1, 1:3], 0.0, atol=1e-12)


def test_backlash_size_of_a_delayed_sinusoid():
    record = BendingRecord(2)
    lag = 0.2
    for k in range(440):
        t = k / 40
        angle = float(calibration_sinusoid()(max(0.0, t - lag))[0])
        record.add(round(t * 1e9), (angle, angle))
    expected = 2.0 * np.deg2rad(90.0) * np.sin(lag)
    assert abs(record.backlash_size(0) - expected) < 0.01


def test_backlash_size_needs_readings_over_the_whole_period():
    record = BendingRecord(2)
    for k in range(440):
        if not 200 <= k < 220:
            record.add(round(k / 40 * 1e9), (0.0, 0.0))
    assert record.backlash_size(0) is None
