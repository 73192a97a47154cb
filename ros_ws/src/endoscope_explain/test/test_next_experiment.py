import dataclasses
from pathlib import Path

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec, JointParameters, PlantDescription
from endoscope_core.rig import shipped_rig
from endoscope_explain import design, operator_changes
from endoscope_explain.audit import audit_recording
from endoscope_explain.case import ExplainedCase, Inputs, Sources
from endoscope_explain.design import Asking, deciding, propose, what_is_asked
from endoscope_explain.experiment_motions import answer_to, is_safe, library
from endoscope_explain.explanation import Explanation, NamedEffect, Verdict
from endoscope_explain.observe.observation import commanded
from endoscope_explain.observe.revisits import Visited
from endoscope_explain.open_questions import DECIDED, OpenQuestion, fitted_laws, open_questions
from endoscope_explain.operator_changes import OperatorChange, what_would_decide
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
    described = PlantDescription({joint: JointParameters() for joint in recording.joints})
    audit = audit_recording(recording, described)
    tried = contest(*names, **changed)
    effect = NamedEffect(names[0], 'bend_x', {}, tried.alternatives(names[0]), contest=tried)
    explanation = Explanation(
        verdict=Verdict.MISSING_PHYSICS,
        effects=(effect,),
        parameters={},
        nominal=described,
        refitted=described,
        augmented=plant,
        fit={},
    )
    return ExplainedCase(
        inputs=Inputs(Sources(Path('rig'), described), audit),
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


def motions_to(*reaches, rig=RIG):
    return library('bend_x', tuple(zip(JOINTS, reaches, strict=False)), rig)


def motion(name, *reaches):
    (found,) = (m for m in motions_to(*(reaches or (1.0,))) if m.name == name)
    return found


def apart(asking, name):
    segment, answers = asking.seen(motion(name, 0.5))
    return asking._apart(segment, answers, refitted=True)  # noqa: SLF001


@pytest.mark.parametrize('reaches', [(1.0,), (1.0, 0.4)])
def test_every_motion_is_short_begins_and_ends_at_rest_and_is_within_the_rigs_limits(reaches):
    motions = motions_to(*reaches)
    assert len({m.name for m in motions}) == len(motions) >= 30
    for each in motions:
        assert each.angle.shape == (len(each.time), len(reaches))
        assert np.abs(each.angle[[0, -1]]).max() < 2e-3
        assert 2.0 < each.duration < 12.0
        assert np.abs(each.angle).max() > 0.0
        assert np.all(np.abs(each.angle).max(axis=0) <= np.array(reaches) + 1e-9)
        speed = np.diff(each.angle, axis=0) / np.diff(each.time)[:, None]
        assert np.abs(speed).max() <= 1.01 * RIG.joints.speed


def test_a_joint_that_hardly_moved_is_asked_for_nothing():
    assert motions_to(0.01, 1.0) == ()
    alone = {m.name for m in motions_to(1.0)}
    assert {m.name for m in motions_to(1.0, 0.01)} == alone
    assert {m.joint for m in motions_to(1.0, 1.0)} == set(JOINTS)


def test_small_motions_are_as_short_and_a_rig_of_small_steps_makes_them_in_full():
    assert max(m.duration for m in motions_to(0.06)) < 12.0
    joints = dataclasses.replace(RIG.joints, entry_step=0.05, speed=7.0)
    motions = motions_to(1.0, rig=dataclasses.replace(RIG, joints=joints))
    stroke = next(m for m in motions if m.name == 'slow stroke')
    assert np.abs(stroke.angle).max() == pytest.approx(1.0, abs=0.01)


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


@pytest.mark.nightly
def test_no_motion_decides_more_per_second_than_the_proposed_one(late_case, asking):
    proposed = propose(late_case, [asking])

    def per_second(segment):
        answers = asking.seen(segment)
        if not answers[1]:
            return 0.0
        return asking.question.brings(
            asking._apart(*answers, refitted=True),  # noqa: SLF001
            segment.duration,
        )[1]

    recorded = late_case.recording
    reach = np.abs(recorded.command.values).max() / recorded.gear
    motions = motions_to(round(float(reach), 3), rig=recorded.rig)
    best = max(motions, key=per_second)
    assert proposed.waveform == best.name


def test_what_was_played_is_not_proposed_again(late_case, asking):
    first = propose(late_case, [asking])
    again = deciding([asking], played={(first.waveform, first.joint)})
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


def test_names_that_are_one_statement_in_the_recordings_are_told_apart_where_a_motion_can(late):
    alone = ('transport_delay', 'actuator_lag', 'load_of_angle')
    case = case_of(late, LATE, 'transport_delay', names=(alone,), gains=(4000.0,))
    (question,) = open_questions(case)
    # A function cannot be simulated as it stands.
    assert question.chances == {'transport_delay': 0.5, 'actuator_lag': 0.5}
    assert propose(case, what_is_asked(case)).separates == ('transport_delay', 'actuator_lag')
    # Beside another statement they are a question of their own, and do not water that one down.
    beside = case_of(
        late, LATE, 'transport_delay', names=(alone, ('gravity',)), gains=(4000.0, 3999.9)
    )
    between, within = open_questions(beside)
    assert between.chances.keys() == {'transport_delay', 'gravity'}
    assert within.chances == question.chances


def test_for_a_law_of_no_name_a_motion_is_asked_for_that_was_never_made(late_case):
    (question,) = open_questions(late_case)
    unnamed = {'transport_delay': 0.5, 'load_of_angle': 0.5}
    asking = Asking.of(late_case, dataclasses.replace(question, chances=unnamed))
    best = asking.best(1, ())
    assert asking._newly_visited(best.segment) > 0.5  # noqa: SLF001
    # What was made is not new any more.
    made = commanded(late_case.recording)[:, 0] / late_case.recording.gear
    visited = Visited.by(made)
    assert visited.newly(made) == 0.0
    assert visited.newly(0.5 * made) > 0.5


def test_evidence_is_weighed_by_probabilities_and_read_at_the_temperature():
    tried = contest('gravity', 'contact')
    question = OpenQuestion('bend_x', {'gravity': 0.5, 'contact': 0.5}, tried, 20.0)
    pairs = {('gravity', 'contact'): 30.0, ('contact', 'gravity'): 50.0}
    nats, per_second = question.brings(pairs, 4.0)
    temperature = tried.temperature(1.0 + 4.0 / 20.0)
    assert nats == pytest.approx(40.0 / temperature)
    assert per_second <= DECIDED / 4.0
    assert temperature > tried.temperature()


def test_where_no_motion_decides_an_operator_may(asking, monkeypatch):
    monkeypatch.setattr(
        operator_changes, 'CHANGES', (OperatorChange('nothing', 1, lambda plant, joint: plant),)
    )
    assert what_would_decide([asking]).startswith('Neither nothing would distinguish')


def stiffer(plant, joint):
    numbers = plant.joints[joint]
    more = dataclasses.replace(numbers, wire_stiffness=3.0 * numbers.wire_stiffness)
    return dataclasses.replace(plant, joints={**plant.joints, joint: more})


def test_a_change_is_credited_with_what_it_adds_alone(asking, monkeypatch):
    monkeypatch.setattr(operator_changes, 'CHANGES', (OperatorChange('stiffer wires', 4, stiffer),))
    brought = iter((5.0, 7.0, 5.0, 9.0))
    best = dataclasses.replace(asking.best(1, ()))
    monkeypatch.setattr(Asking, 'best', lambda *_: dataclasses.replace(best, nats=next(brought)))
    assert what_would_decide([asking]).startswith('Neither stiffer wires')
    assert what_would_decide([asking]).startswith('Stiffer wires would distinguish')


def test_a_number_that_is_not_known_any_more_leaves_the_others_less_known(asking):
    law = asking.laws['transport_delay']
    names = [item.name for item in law.model.free]
    k = names.index('capstan_exponent')
    before = np.linalg.inv(law.precision)
    changed = law.once(lambda plant, joint: plant, 'capstan_exponent')
    after = np.linalg.inv(changed.precision)
    others = [i for i in range(len(names)) if i != k]
    np.testing.assert_allclose(
        after[np.ix_(others, others)], before[np.ix_(others, others)], rtol=1e-6
    )
    assert after[k, k] > before[k, k]


def test_sensors_that_read_nothing_limit_nothing_and_stop_nothing(asking):
    recorded = asking.recording
    blind = np.zeros_like(recorded.tension.valid)
    frozen = dataclasses.replace(
        recorded, tension=dataclasses.replace(recorded.tension, valid=blind)
    )
    assert asking.seen(motion('stroke', 0.5))[1]
    assert dataclasses.replace(asking, recording=frozen).seen(motion('stroke', 0.5))[1]
    unseen = np.zeros_like(recorded.bending.valid)
    lost = dataclasses.replace(
        recorded, bending=dataclasses.replace(recorded.bending, valid=unseen)
    )
    assert dataclasses.replace(asking, recording=lost).best(1, ()) is None


def test_of_two_joints_each_keeps_to_what_it_has_been_through(record):
    plant = dataclasses.replace(LATE, joints=PlantDescription().joints)
    case = case_of(record(plant, duration=6.0), plant, 'transport_delay', 'actuator_lag')
    (asking,) = what_is_asked(case)
    command = np.abs(case.recording.command.values).max(axis=0) / case.recording.gear
    for each in design._within(case.recording, 'bend_x'):  # noqa: SLF001
        assert np.all(np.abs(each.angle).max(axis=0) <= command + 1e-3)
    beside = next(m for m in design._within(case.recording, 'bend_x') if 'beside' in m.name)  # noqa: SLF001
    segment, answers = asking.seen(beside)
    assert answers
    assert np.abs(segment.angle).max(axis=0).min() > 0.0
    proposed = propose(case, [asking])
    table = np.array(proposed.command)
    reach = np.abs(table).max(axis=0)
    assert np.all(reach <= command + 1e-3)
