from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.audit import Severity, audit_recording
from endoscope_explain.audit.examined import retimed
from endoscope_explain.audit.findings.stray_poses import spike_chance

PLANT = PlantDescription()


@pytest.fixture(scope='module')
def sound(record):
    return record()


def named(recording):
    return {f.id: f for f in audit_recording(recording, PLANT).findings}


def audited(recording, quantity, **fields):
    """The audit of a recording of which a series has other times or values."""
    series = replace(recording.measured()[quantity], **fields)
    return audit_recording(recording.with_series({quantity: series}), PLANT)


def test_a_sound_recording_has_no_findings_and_stays_as_it_is(sound):
    report = audit_recording(sound, PLANT)
    assert report.findings == ()
    for name, series in sound.measured().items():
        kept = report.recording.measured()[name]
        assert np.array_equal(kept.values, series.values)
        assert kept.valid.all()


@pytest.mark.parametrize(
    'quantity', ['bending', pytest.param('tension', marks=pytest.mark.nightly)]
)
def test_a_gap_is_named_with_its_topic_and_its_beginning(sound, quantity):
    series = sound.measured()[quantity]
    keep = (series.time < 4.2) | (series.time >= 4.9)
    finding = named(sound.with_series({quantity: series.taken(keep)}))['recording_gap']
    assert finding.signals == (series.topic,)
    onset = finding.parameters['time_s']
    assert onset.low - 1e-9 <= 4.2 <= onset.high + 1e-9
    assert finding.severity is Severity.FAULT


def test_readings_without_noise_may_repeat_themselves(record):
    """As those of a simulation, whose joint stands still while the motor turns back."""
    silent = replace(PLANT.sensors, load_cell_noise=0.0, tracker_noise=0.0)
    recording = record(replace(PLANT, sensors=silent))
    assert 'held_samples' not in named(recording)


def test_a_topic_that_starts_late_has_a_gap(sound):
    finding = named(sound.with_series({'bending': sound.bending.taken(sound.bending.time > 2.0)}))
    assert finding['recording_gap'].intervals[0][0] == 0.0


def test_one_lost_sample_is_no_gap(sound):
    lost = np.arange(len(sound.bending.time)) != 100
    assert named(sound.with_series({'bending': sound.bending.taken(lost)})) == {}


def test_a_command_that_pauses_is_no_gap(sound):
    """A master that rests publishes nothing; the last command stays in force."""
    command = sound.command
    paused = (command.time > 5.0) & (command.time < 6.0)
    held = command.values[np.searchsorted(command.time, 5.0)]
    values = np.where(paused[:, None], held, command.values)
    after = command.time >= 6.0
    values[after] += held - command.values[np.argmax(after)]
    pausing = replace(command, values=values).taken(~paused)
    assert audit_recording(sound.with_series({'command': pausing}), PLANT).faults() == ()


def test_a_command_that_begins_late_or_ends_early_is_no_gap(sound):
    command = sound.command
    amidst = (command.time > 1.0) & (command.time < command.time[-1] - 1.0)
    late = sound.with_series({'command': command.taken(amidst)})
    assert audit_recording(late, PLANT).faults() == ()


def test_the_pose_that_a_driver_held_in_a_pause_is_what_it_was_sent_to(record):
    """As the motor driver does 0.1 s after the last command, short of where that had sent it."""
    time = 1e-3 * np.arange(8000)
    motion = 0.5 * np.stack([np.sin(4.0 * time), np.sin(3.0 * time)], axis=1)
    begin, told, end = 2480, 2580, 5000
    motion[begin:] = motion[begin]
    pose = record(duration=8.0, command=motion).shaft_position.values[told]
    assert np.abs(pose - motion[begin]).max() > 0.003
    motion[told:] = pose
    motion[end:] += 0.2 * np.sin(2.0 * (time[end:] - time[end]))[:, None]
    whole = record(duration=8.0, command=motion)
    heard = whole.command.taken((time <= time[begin]) | (time >= time[end]))
    report = audit_recording(whole.with_series({'command': heard}), PLANT)
    assert [(f.id, f.severity) for f in report.findings] == [('held_pose', Severity.NOTE)]
    of_driver = report.recording.command
    added = (of_driver.time > time[begin]) & (of_driver.time < time[end])
    assert of_driver.time[added][0] == pytest.approx(time[told], abs=2e-3)
    assert of_driver.values[added][-1] == pytest.approx(pose, abs=1e-9)
    assert of_driver.values[~added] == pytest.approx(heard.values)


def test_where_the_last_command_stayed_in_force_no_pose_was_held(record):
    time = 1e-3 * np.arange(6000)
    motion = 0.5 * np.stack([np.sin(4.0 * time), np.sin(3.0 * time)], axis=1)
    motion[2480:] = motion[2480]
    whole = record(duration=6.0, command=motion)
    heard = whole.command.taken(time <= time[2480])
    report = audit_recording(whole.with_series({'command': heard}), PLANT)
    assert report.findings == ()
    assert np.array_equal(report.recording.command.time, heard.time)


def test_nothing_is_judged_while_the_command_is_unknown(sound):
    command = sound.command
    keep = (command.time < 5.0) | (command.time >= 5.5)
    report = audit_recording(sound.with_series({'command': command.taken(keep)}), PLANT)
    valid = report.recording.tension.valid.all(axis=(1, 2))
    time = report.recording.tension.time
    assert not valid[(time > 5.01) & (time < 5.49)].any()
    assert valid[(time < 4.9) | (time > 6.1)].all()


def test_repeated_stamps_are_dropped_and_noted(sound):
    doubled = sound.bending.taken(np.sort(np.r_[np.arange(480), np.arange(100, 140)]))
    report = audit_recording(sound.with_series({'bending': doubled}), PLANT)
    assert [f.id for f in report.findings] == ['repeated_stamps']
    assert np.array_equal(report.recording.bending.time, sound.bending.time)


def test_swapped_neighbours_are_put_in_order(sound):
    order = np.arange(len(sound.tension.time))
    order[[500, 501]] = [501, 500]
    report = audit_recording(sound.with_series({'tension': sound.tension.taken(order)}), PLANT)
    (finding,) = report.findings
    assert (finding.id, finding.severity) == ('unordered_stamps', Severity.NOTE)
    assert np.array_equal(report.recording.tension.values, sound.tension.values)


@pytest.mark.parametrize(
    ('quantity', 'jitter'),
    [('bending', 0.02), pytest.param('tension', 0.005, marks=pytest.mark.nightly)],
)
def test_stamps_that_jitter_are_noted_with_how_much(sound, quantity, jitter):
    series = sound.measured()[quantity]
    off = np.random.default_rng(1).normal(0.0, jitter, len(series.time))
    finding = named(sound.with_series({quantity: replace(series, time=series.time + off)}))
    noted = finding['jittering_stamps']
    assert (noted.signals, noted.severity) == ((series.topic,), Severity.NOTE)
    assert noted.evidence['jitter_s'] == pytest.approx(jitter, rel=0.1)


@pytest.mark.nightly
def test_a_clock_that_is_set_back_is_a_fault(sound):
    time = sound.bending.time.copy()
    time[300:] -= 1.0
    finding = named(sound.with_series({'bending': replace(sound.bending, time=time)}))
    assert finding['unordered_stamps'].severity is Severity.FAULT


def test_a_frozen_cell_is_found_and_not_judged(sound):
    values = sound.tension.values.copy()
    values[3000:3400, 0, 1] = values[3000, 0, 1]
    report = audited(sound, 'tension', values=values)
    (finding,) = report.findings
    assert (finding.id, finding.signals) == ('held_samples', ('wires/measured_js:wire_x_neg',))
    assert not report.recording.tension.valid[3001:3400, 0, 1].any()
    assert report.recording.tension.valid.sum() == values.size - 399


def test_a_motor_that_repeats_an_old_position_is_found_and_not_judged(sound):
    values = sound.shaft_position.values.copy()
    values[3000:3400, 0] = values[3000, 0]
    report = audited(sound, 'shaft_position', values=values)
    (finding,) = report.findings
    assert finding.id == 'held_samples'
    assert finding.signals == ('motor/measured_js:motor_x.position',)
    for series in (report.recording.shaft_velocity, report.recording.shaft_position):
        assert not series.valid[3001:3400, 0].any()
        # The reading may have stood there just before.
        assert 0 <= series.valid.size - 399 - series.valid.sum() <= 5


def test_a_motor_that_rests_is_no_fault(sound):
    position = sound.shaft_position
    rest = np.searchsorted(position.time, [3.0, 3.5])
    at = np.r_[: rest[0], np.full(500, rest[0]), rest[0] : len(position.time) - 500]
    resting = replace(position, values=position.values[at])
    assert 'held_samples' not in named(sound.with_series({'shaft_position': resting}))


def test_a_coarse_tracker_that_stands_still_with_the_rig_is_no_fault(sound):
    coarse = np.round(sound.bending.values / 0.03) * 0.03
    assert named(sound.with_series({'bending': replace(sound.bending, values=coarse)})) == {}


def test_clipping_is_named_with_wire_and_limit(sound):
    values = np.minimum(sound.tension.values, np.array([np.inf, 9.0])[None, None, :])
    values[:, 1] = sound.tension.values[:, 1]
    report = audited(sound, 'tension', values=values)
    (finding,) = report.findings
    assert (finding.id, finding.joint) == ('load_cell_saturation', 'bend_x')
    assert finding.parameters['limit_n'].value == pytest.approx(9.0)
    assert finding.parameters['wire'].value == 1.0
    assert report.recording.tension.valid[values == 9.0].mean() < 0.01


@pytest.mark.parametrize(
    ('size', 'share'), [pytest.param(0.2, 0.02, marks=pytest.mark.nightly), (0.05, 0.01)]
)
def test_isolated_wrong_tracker_samples_are_found(sound, size, share):
    rng = np.random.default_rng(3)
    values = sound.bending.values.copy()
    wrong = rng.choice(np.arange(10, len(values) - 10), int(share * len(values)), replace=False)
    values[wrong, 1] += size * rng.choice([-1, 1], len(wrong))
    report = audited(sound, 'bending', values=values)
    (finding,) = report.findings
    assert (finding.id, finding.joint) == ('tracker_outliers', 'bend_y')
    masked = ~report.recording.bending.valid[:, 1]
    assert masked[wrong].mean() >= 0.7
    assert masked[np.setdiff1d(np.arange(len(values)), wrong)].mean() < 0.005


def test_spikes_of_pure_noise_are_as_rare_as_said():
    noise = np.random.default_rng(1).standard_normal(200_001)
    before, after = noise[1:-1] - noise[:-2], noise[1:-1] - noise[2:]
    height = 1.5
    seen = ((before * after > 0) & (np.minimum(abs(before), abs(after)) > height)).mean()
    assert spike_chance(np.array([height]), 1.0)[0] == pytest.approx(seen, rel=0.05)


@pytest.mark.parametrize('skew', [pytest.param(2e-3, marks=pytest.mark.nightly), -5e-4])
def test_a_skewed_clock_shows_in_the_times_of_receipt(sound, skew):
    rng = np.random.default_rng(5)
    every = {'command': sound.command, **sound.measured()}
    received = {
        name: replace(s, received=s.time + 2e-4 + rng.exponential(3e-4, len(s.time)))
        for name, s in every.items()
    }
    tracker = received['bending']
    received['bending'] = replace(tracker, time=tracker.time * (1.0 + skew))
    report = audit_recording(sound.with_series(received), PLANT)
    finding = next(f for f in report.findings if f.id == 'clock_skew')
    assert finding.signals == ('slave/measured_js',)
    assert finding.parameters['skew'].value == pytest.approx(skew, rel=0.05)
    assert report.recording.bending.time == pytest.approx(sound.bending.time, abs=1e-3)


def test_retiming_undoes_a_skew(sound):
    fast = replace(sound.bending, time=1.0 + 1.01 * (sound.bending.time - 1.0))
    assert retimed(fast, 0.01, start=1.0).time == pytest.approx(sound.bending.time)
