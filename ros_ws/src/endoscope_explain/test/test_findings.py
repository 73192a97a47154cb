"""Each kind of finding is found where its fault is, and none in a sound recording."""

import re
from dataclasses import replace
from string import Formatter

import numpy as np
import pytest

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.audit import STEPS, audit_recording
from endoscope_explain.audit.finding import FindingKind
from endoscope_explain.audit.findings import (
    clock_rate,
    earlier_motion,
    frozen,
    held_pose,
    held_samples,
    load_cells,
    misread,
    missing_samples,
    motor_at_rest,
    stamp_jitter,
    stamp_order,
    stamp_unit,
    stray_poses,
)

PLANT = PlantDescription()
KINDS = tuple(
    kind for step in STEPS for kind in vars(step).values() if isinstance(kind, FindingKind)
)
MOTOR = ('shaft_position', 'shaft_velocity', 'shaft_effort')


def every(recording):
    return {'command': recording.command, **recording.measured()}


def timed(change, *quantities):
    """Change the stamps of some quantities, or of all."""

    def fault(sound):
        found = {q: s for q, s in every(sound).items() if q in quantities or not quantities}
        return sound.with_series({q: replace(s, time=change(s.time)) for q, s in found.items()})

    return fault


def read(change, *quantities):
    """Change the values of some quantities, at their times."""

    def fault(sound):
        found = {q: every(sound)[q] for q in quantities}
        changed = {q: change(s.time, s.values.copy()) for q, s in found.items()}
        return sound.with_series({q: replace(found[q], values=v) for q, v in changed.items()})

    return fault


def put(value, begin=0, end=None, *columns):
    """Set values of some samples and columns to a function of them."""

    def change(_, values):
        at = (slice(begin, end), *columns)
        values[at] = value(values[at])
        return values

    return change


def standing(values):
    return np.broadcast_to(values[:1], values.shape)


def taken(index, quantity):
    return lambda sound: sound.with_series({quantity: every(sound)[quantity].taken(index)})


def off_by_jitter(time):
    return time + np.random.default_rng(1).normal(0.0, 0.02, len(time))


def received_with_a_fast_tracker(sound):
    rng = np.random.default_rng(5)
    series = {
        q: replace(s, received=s.time + rng.exponential(3e-4, len(s.time)))
        for q, s in every(sound).items()
    }
    series['bending'] = replace(series['bending'], time=1.002 * series['bending'].time)
    return sound.with_series(series)


def without_a_second(sound, **fields):
    bending = replace(sound.bending, **fields)
    kept = (bending.time < 4.0) | (bending.time > 5.0)
    return sound.with_series({'bending': bending.taken(kept)})


def given_up_in_motion(sound):
    """From 8 s on there are no commands, and the motors stay where they were then."""
    position, command = sound.shaft_position, sound.command
    values = position.values.copy()
    values[8000:] = values[8000]
    heard = command.taken(command.time < 8.0)
    return sound.with_series({'command': heard, 'shaft_position': replace(position, values=values)})


def between(begin, end):
    def fault(sound):
        later = {}
        for name, series in every(sound).items():
            kept = series.taken((series.time >= begin) & (series.time < end))
            later[name] = replace(kept, time=kept.time - begin)
        return sound.with_series(later)

    return fault


SWAPPED = np.r_[:500, 501, 500, 502:12000]
FAULTS = {
    stamp_order.UNORDERED: taken(SWAPPED, 'tension'),
    stamp_order.SET_BACK: timed(lambda t: t - np.where(t > 6.0, 1.0, 0.0), 'bending'),
    stamp_order.REPEATED: taken(np.sort(np.r_[np.arange(480), np.arange(100, 140)]), 'bending'),
    stamp_unit.KIND: timed(lambda time: 1e3 * time),
    stamp_jitter.KIND: timed(off_by_jitter, 'bending'),
    clock_rate.KIND: received_with_a_fast_tracker,
    missing_samples.MISSING: without_a_second,
    missing_samples.PAUSED: lambda sound: without_a_second(sound, lost=np.zeros(480, int)),
    frozen.KIND: read(put(standing), 'bending'),
    misread.UNIT: read(put(np.degrees), 'bending'),
    misread.COUNTS: read(put(lambda values: 2e4 * values), 'tension'),
    misread.GEAR: read(put(lambda values: 1.5 * values), 'shaft_position'),
    misread.SIGN: read(put(np.negative), 'tension'),
    misread.EXCHANGED: read(put(lambda values: values[:, ::-1].copy()), 'bending'),
    misread.UNLIKE: read(
        lambda time, values: 0.3 * np.sin(19.0 * time)[:, None] + 0.0 * values, 'bending'
    ),
    motor_at_rest.KIND: read(put(standing, 0, None, 1), 'shaft_position', 'shaft_velocity'),
    held_pose.KIND: given_up_in_motion,
    load_cells.ABSENT: lambda sound: replace(sound, tension=None),
    load_cells.SATURATED: read(put(lambda values: np.minimum(values, 9.0)), 'tension'),
    held_samples.KIND: read(put(standing, 3000, 3030, 0, 1), 'tension'),
    held_samples.LONG: read(put(standing, 3000, 3400, 0, 1), 'tension'),
    stray_poses.KIND: read(
        put(lambda values: values + np.where(np.arange(480) % 50 == 20, 0.2, 0.0), 0, None, 1),
        'bending',
    ),
    earlier_motion.NOT_JUDGED: between(3.1, 9.0),
    earlier_motion.ESTIMATED: between(5.0, 7.5),
}


@pytest.fixture(scope='module')
def sound(record):
    return record()


def test_every_kind_has_a_fault_here():
    assert {*FAULTS} == {*KINDS}
    assert len(FAULTS) == len(KINDS)


def is_of(kind, finding):
    """Whether a finding is of a kind, by all that is the same of every one of it."""
    same = (kind.id, kind.severity) == (finding.id, finding.severity)
    return same and all(
        re.fullmatch('.*'.join(re.escape(part) for part, *_ in Formatter().parse(of)) + '.*', text)
        for of, text in ((kind.text, finding.text), (kind.remedy, finding.remedy))
    )


@pytest.mark.parametrize('kind', KINDS, ids=lambda kind: f'{kind.id}-{kind.severity}')
def test_a_kind_is_found_with_a_sentence_and_a_remedy_where_its_fault_is(kind, sound):
    assert re.fullmatch('[a-z_]+', kind.id)
    assert kind.text
    assert kind.remedy
    findings = audit_recording(FAULTS[kind](sound), PLANT).findings
    assert [f for f in findings if is_of(kind, f)], [f.text for f in findings]


def test_no_kind_is_found_in_a_sound_recording(sound):
    assert audit_recording(sound, PLANT).findings == ()
