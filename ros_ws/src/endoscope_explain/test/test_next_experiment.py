import dataclasses

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec, JointParameters, PlantDescription
from endoscope_core.rig import shipped_rig
from endoscope_explain import design
from endoscope_explain.audit import audit_recording
from endoscope_explain.case import ExplainedCase
from endoscope_explain.design import Asking, propose, what_is_asked
from endoscope_explain.experiment_motions import library
from endoscope_explain.explanation import Explanation, NamedEffect, Verdict
from endoscope_explain.imagined_motion import answer_to, is_safe
from endoscope_explain.open_questions import OpenQuestion, fitted_laws, open_questions
from endoscope_explain.operator_changes import CHANGES, what_would_decide
from endoscope_explain.prediction_set import OTHER_NUMBERS, SOMETHING_ELSE, Contest

ONE = PlantDescription({'bend_x': JointParameters()})
JOINTS = ('bend_x', 'bend_y')
RIG = shipped_rig()


def with_effects(*effects):
    specs = tuple(EffectSpec(name, 'bend_x', numbers) for name, numbers in effects)
    return dataclasses.replace(ONE, effects=specs)


LATE = with_effects(('transport_delay', {'delay_s': 0.03}))


def contest(*names, **changed):
    gains = tuple(4000.0 - 0.1 * k for k in range(len(names)))
    found = Contest(tuple((name,) for name in names), gains, 5.0, True)
    return dataclasses.replace(found, **changed)


def case_of(recording, plant, *names, **changed):
    """A case in which the first of some names is said, and all are left open."""
    audit = audit_recording(recording, ONE)
    tried = contest(*names, **changed)
    effect = NamedEffect(names[0], 'bend_x', {}, tried.alternatives(names[0]), contest=tried)
    explanation = Explanation(
        verdict=Verdict.MISSING_PHYSICS,
        effects=(effect,),
        parameters={},
        nominal=ONE,
        refitted=ONE,
        augmented=plant,
        fit={},
    )
    return ExplainedCase(
        recording=audit.recording,
        audit=audit,
        explanation=explanation,
        verdict=Verdict.MISSING_PHYSICS,
        effects=(effect,),
        places=(),
        plant=plant,
        ladder={},
    )


@pytest.fixture(scope='module')
def late(record):
    """What is recorded of a rig that is late."""
    return record(LATE, duration=6.0)


@pytest.fixture(scope='module')
def late_case(late):
    return case_of(late, LATE, 'transport_delay', 'actuator_lag')


@pytest.fixture(scope='module')
def asking(late_case):
    (question,) = open_questions(late_case)
    return Asking.of(late_case, question)


def motion(name, reach=1.0, joints=('bend_x',)):
    (found,) = (m for m in library('bend_x', joints, reach, RIG) if m.name == name)
    return found


def apart(asking, name):
    segment, answers = asking.seen(motion(name, 0.5))
    return asking._apart(segment, answers, refitted=True)  # noqa: SLF001


@pytest.mark.parametrize('joints', [('bend_x',), JOINTS])
def test_every_motion_is_short_begins_and_ends_at_rest_and_is_within_the_rigs_limits(joints):
    motions = library('bend_x', joints, 1.0, RIG)
    assert len({m.name for m in motions}) == len(motions) >= 30
    for each in motions:
        assert each.angle.shape == (len(each.time), len(joints))
        assert np.abs(each.angle[[0, -1]]).max() < 2e-3
        assert 2.0 < each.duration < 12.0
        assert 0.0 < np.abs(each.angle).max() <= 1.0 + 1e-9
        speed = np.diff(each.angle, axis=0) / np.diff(each.time)[:, None]
        assert np.abs(speed).max() <= 1.01 * RIG.joints.speed


def test_a_law_is_no_distance_from_itself(late_case, asking):
    same = dict.fromkeys(asking.laws, asking.laws['transport_delay'])
    twice = dataclasses.replace(asking, laws=same)
    assert max(apart(twice, 'steps').values()) < 1e-6


def test_delay_and_lag_part_in_quick_moves_and_not_in_slow_ones(asking):
    quick, slow = (min(apart(asking, name).values()) for name in ('steps', 'slow stroke'))
    assert quick > 10.0 * slow


def test_a_refit_brings_laws_nearer(asking):
    segment, answers = asking.seen(motion('stroke', 0.5))
    before = asking._apart(segment, answers)  # noqa: SLF001
    after = asking._apart(segment, answers, refitted=True)  # noqa: SLF001
    assert before.keys() == after.keys()
    assert all(after[pair] <= before[pair] for pair in before)


def test_a_motion_beyond_what_the_rig_has_been_through_is_not_safe():
    stroke = motion('stroke')
    answer = answer_to(ONE, stroke.name, stroke.time, stroke.angle, RIG)
    most, widest = answer.tension.values.max(), np.abs(answer.bending.values).max()
    assert is_safe(answer, most, widest)
    assert not is_safe(answer, 0.99 * most, widest)
    assert not is_safe(answer, most, 0.99 * widest)


def test_the_proposal_names_its_laws_and_lasts_seconds(late_case, asking):
    proposed = propose(late_case, [asking])
    assert proposed.separates == ('transport_delay', 'actuator_lag')
    assert proposed.joints == JOINTS
    command = np.array(proposed.command)
    assert command.shape == (len(proposed.time), 2)
    assert not command[:, 1].any()
    assert proposed.time[-1] < 12.0
    assert f'{proposed.waveform.capitalize()} of bend_x' in proposed.why


def test_no_motion_decides_more_per_second_than_the_proposed_one(late_case, asking):
    proposed = propose(late_case, [asking])

    def per_second(segment):
        answers = asking.seen(segment)
        if not answers[1]:
            return 0.0
        return asking.question.brings(
            asking._apart(*answers, refitted=True),  # noqa: SLF001
            segment.duration,
            design.DECIDED,
        )[1]

    recorded = late_case.recording
    reach = np.abs(recorded.command.values).max() / recorded.gear
    motions = library('bend_x', recorded.joints, round(float(reach), 3), recorded.rig)
    best = max(motions, key=per_second)
    assert proposed.waveform == best.name


def test_what_was_played_is_not_proposed_again(late_case, asking):
    first = propose(late_case, [asking])
    again = propose(late_case, [asking], played={(first.waveform, first.joint)})
    assert again.waveform != first.waveform


def test_where_no_motion_is_safe_none_is_proposed(late_case, asking):
    tension = late_case.recording.tension
    weak = dataclasses.replace(tension, values=0.2 * tension.values)
    recording = dataclasses.replace(late_case.recording, tension=weak)
    unsafe = dataclasses.replace(asking, recording=recording)
    assert propose(late_case, [unsafe]) is None


def test_where_nothing_is_open_there_is_nothing_to_ask(late_case):
    (effect,) = late_case.effects
    certain = dataclasses.replace(effect, contest=None)
    case = dataclasses.replace(late_case, effects=(certain,))
    assert what_is_asked(case) == []
    assert propose(case, []) is None


def test_a_law_that_is_there_besides_is_none(record):
    both = with_effects(
        ('transport_delay', {'delay_s': 0.03}), ('actuator_lag', {'time_constant_s': 0.02})
    )
    case = case_of(record(both, duration=8.0), both, 'transport_delay', 'actuator_lag')
    (question,) = open_questions(case)
    assert fitted_laws(case, question).keys() == {'transport_delay'}


def test_other_numbers_are_a_law_and_a_function_is_something_else(late):
    numbers = dataclasses.replace(ONE.joints['bend_x'], joint_friction=0.02)
    others = dataclasses.replace(ONE, joints={'bend_x': numbers})
    case = case_of(late, others, OTHER_NUMBERS, 'transport_delay', 'load_of_angle')
    tried = case.effects[0].contest
    explanation = dataclasses.replace(case.explanation, effects=(), contests={'bend_x': tried})
    case = dataclasses.replace(case, effects=(), explanation=explanation)
    (question,) = open_questions(case)
    chances = Asking.of(case, question).question.chances
    assert chances.keys() == {OTHER_NUMBERS, 'transport_delay', SOMETHING_ELSE}
    assert chances[SOMETHING_ELSE] == pytest.approx(question.chances['load_of_angle'], rel=0.1)
    assert propose(case, what_is_asked(case)).separates[:2] == (OTHER_NUMBERS, 'transport_delay')


def test_for_a_law_of_no_name_a_motion_is_asked_for_that_was_never_made(late_case):
    (question,) = open_questions(late_case)
    unnamed = {'transport_delay': 0.5, 'load_of_angle': 0.5}
    asking = Asking.of(late_case, dataclasses.replace(question, chances=unnamed))
    best = asking.best(1, ())
    assert asking._newly_visited(best.segment) > 0.5  # noqa: SLF001
    # What was just made is not new any more.
    made = asking._newly_visited(motion('stroke', 0.9))  # noqa: SLF001
    assert made < 0.1


def test_evidence_is_weighed_by_probabilities_and_read_at_the_temperature():
    tried = contest('gravity', 'contact')
    question = OpenQuestion('bend_x', {'gravity': 0.5, 'contact': 0.5}, tried, 20.0)
    pairs = {('gravity', 'contact'): 30.0, ('contact', 'gravity'): 50.0}
    nats, per_second = question.brings(pairs, 4.0, design.DECIDED)
    temperature = tried.temperature(1.0 + 4.0 / 20.0)
    assert nats == pytest.approx(40.0 / temperature)
    assert per_second <= design.DECIDED / 4.0
    assert temperature > tried.temperature()


def test_where_no_motion_decides_an_operator_may(asking, monkeypatch):
    assert what_would_decide([asking]).split(' would distinguish ')[0].lower() in {
        change.words.lower() for change in CHANGES
    }
    monkeypatch.setattr(design, 'LEAST_NATS', 1e9)
    assert what_would_decide([asking]).startswith('Neither a weight of 5 g')
