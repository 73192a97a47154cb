"""The loop of motions and explanations, on simulated rigs."""

import dataclasses
import json
from functools import partial
from importlib.metadata import version

import numpy as np
import pytest

from endoscope_core.errors import EndoscopeError, InputError, NotPlayedError, RigStoppedError
from endoscope_core.investigation_folder import LOG, PAGE, held, is_left_behind
from endoscope_core.names import JOINTS
from endoscope_core.physics.description import EffectSpec, JointParameters, PlantDescription
from endoscope_core.physics.plant_file import load_plant, save_plant
from endoscope_core.physics.simulator import TICK
from endoscope_core.rig import shipped_rig
from endoscope_core.signals import hold, move, sequence
from endoscope_core.signals.sampled_motion import CommandTable, read_command_file
from endoscope_explain import prediction_set
from endoscope_explain.audit import audit_recording
from endoscope_explain.case import Inputs, Sources
from endoscope_explain.explanation import Verdict
from endoscope_explain.investigation import index_page
from endoscope_explain.investigation.investigation import Investigation, investigate
from endoscope_explain.investigation.log import LOG_MD, PLANT, Stop, begun
from endoscope_explain.investigation.motions import (
    MotionRefusedError,
    RigMotion,
    calibration,
    commissioning,
    require_allowed,
)
from endoscope_explain.observe.revisits import EVERY_S, LEAST_SHARE, seen_before, strokes
from endoscope_explain.pipeline import explain_case
from endoscope_explain.prediction_set import Contest
from endoscope_explain.report.left_open import once_only
from endoscope_explain.takes import inputs_joined

pytestmark = pytest.mark.engine

TO_ONE_SIDE = sequence(
    'to one side', [hold(1.0), move(0.0, 0.9, 2.0), hold(1.5, 0.9), move(0.9, 0.0, 2.0), hold(1.0)]
)
"""Too little to tell a bias from crosstalk."""
RIG = shipped_rig()
ONE = PlantDescription({'bend_x': JointParameters()})
BIAS = EffectSpec('load_cell_bias', 'bend_x', {})


class SimulatedRig:
    """A rig of one joint whose recordings are kept in memory."""

    def __init__(self, record, plant):
        self._record, self._plant = record, plant
        self.recordings = {}
        self.played = []

    def play(self, motion, file, bag):
        """Play a motion as far as the file asks; the first one is a short one."""
        table = read_command_file(file)
        time, angle = table.time, table.angle[:, :1]
        if not self.played:
            signal = TO_ONE_SIDE
            time = np.arange(0.0, signal.duration, 0.001)
            angle = signal(time)[0][:, None]
        ticks = np.arange(0.0, time[-1], 0.001)
        shaft = RIG.joints.gear * np.interp(ticks, time, angle[:, 0])[:, None]
        duration = len(shaft) * 0.001
        self.played.append(motion.waveform)
        recording = self._record(self._plant, duration, len(self.played), shaft)
        self.recordings[bag] = dataclasses.replace(recording, name=bag.name, rig=RIG)

    def explain(self, bags, known):
        """Explain the recordings of bags together, as `explain_together` does."""
        inputs = []
        for bag in bags:
            before = inputs[-1].audit if inputs else None
            audit = audit_recording(self.recordings[bag], ONE, before)
            inputs.append(Inputs(Sources(bag, ONE, quick=True, effects=1), audit))
        return explain_case(inputs_joined(inputs))


@pytest.fixture
def plant_file(tmp_path):
    file = tmp_path / 'described.yaml'
    save_plant(ONE, file)
    return file


def log_of(folder):
    return json.loads((folder / LOG).read_text())


@pytest.mark.nightly
def test_a_second_motion_tells_the_rivals_that_the_first_one_left(record, tmp_path, plant_file):
    rig = SimulatedRig(record, dataclasses.replace(ONE, effects=(BIAS,)))
    out = tmp_path / 'out'
    log = investigate(Investigation(out, plant_file, RIG), rig.play, rig.explain)
    first, last = (each.answer.names for each in log.rounds)
    assert [(name.id, bool(name.rivals)) for name in first] == [('load_cell_bias', True)]
    assert [(name.id, bool(name.rivals)) for name in last] == [('load_cell_bias', False)]
    assert log.stopped is Stop.ONE_CLASS
    assert rig.played == [log.rounds[0].motion, log.rounds[1].motion]
    (spec,) = load_plant(out / PLANT).effects
    assert spec.parameters['bias_n'] == pytest.approx(0.3, abs=0.01)
    assert 'confounded with load_cell_crosstalk' in (out / LOG_MD).read_text()


def no_rig(motion, file, bag):
    """Make a folder in place of a recording, since what it says is given."""
    bag.mkdir()


@pytest.fixture
def both(tmp_path):
    """An investigation of a rig of two joints."""
    file = tmp_path / 'described.yaml'
    save_plant(PlantDescription(), file)
    return Investigation(tmp_path / 'out', file, RIG, experiments=1)


@pytest.fixture
def stribeck_case(stribeck_case):
    """The case, with another law left open beside the one that is named."""
    (effect,) = stribeck_case.effects
    tried = Contest((('stribeck_friction',), ('viscous_friction',)), (4e3, 3999.0), 5.0, True)
    effects = (dataclasses.replace(effect, contest=tried),)
    return dataclasses.replace(stribeck_case, effects=effects)


@pytest.fixture
def certain(stribeck_case):
    """A case in which no name has an alternative."""
    (effect,) = stribeck_case.effects
    alone = dataclasses.replace(effect, alternatives=(), contest=None)
    return dataclasses.replace(stribeck_case, effects=(alone,))


def test_no_more_motions_are_asked_for_than_are_wanted_and_names_and_numbers_are_known_to_the_next(
    both, stribeck_case
):
    known_then = []

    def explain(bags, known):
        known_then.append(known)
        return stribeck_case

    log = investigate(both, no_rig, explain)
    (effect,) = stribeck_case.plant.effects
    numbers = {'stribeck_friction': effect.parameters, 'viscous_friction': {}}
    assert known_then == [{}, {'bend_x': numbers}]
    assert log.stopped is Stop.USED_UP
    assert log.rounds[0].motion == 'calibration'
    assert len(log.rounds) == 2
    assert 'viscous_friction' in log.words
    times = (both.folder / LOG_MD).read_text().split('## Times')[1]
    assert times.count('explaining') == 2
    assert log.rounds[0].proposed_s > 0.0


@pytest.mark.nightly
def test_more_motions_continue_it_and_none_is_asked_for_again(both, stribeck_case):
    investigate(both, no_rig, lambda bags, known: stribeck_case)
    again = investigate(
        dataclasses.replace(both, experiments=2), no_rig, lambda bags, known: stribeck_case
    )
    assert len(again.rounds) == 3
    motions = {(each.motion, each.joint) for each in again.rounds}
    assert len(motions) == 3


def test_a_fault_ends_it_with_what_is_known_and_it_is_continued(both, stribeck_case, certain):
    def breaks_down(motion, file, bag):
        if bag.name == 'bag_2':
            raise RigStoppedError('FAULT: wire_x_pos at 61 N')
        bag.mkdir()

    log = investigate(both, breaks_down, lambda bags, known: stribeck_case)
    assert log.stopped is Stop.FAULT
    assert 'wire_x_pos at 61 N' in log.words
    assert log.rounds[0].answer.names[0].id == 'stribeck_friction'
    assert not log.rounds[1].recorded
    assert 'wire_x_pos at 61 N' in log.rounds[1].ended
    assert load_plant(both.folder / PLANT).effects
    explained = []

    def explain(bags, known):
        explained.append([bag.name for bag in bags])
        return certain if len(bags) > 1 else stribeck_case

    again = investigate(both, no_rig, explain)
    # The recording that broke off is used no more, and its motion is asked for again.
    assert explained == [['bag_1'], ['bag_1', 'bag_3']]
    assert again.stopped is Stop.ONE_CLASS


@pytest.mark.parametrize(
    ('error', 'stopped', 'words'),
    [
        (KeyboardInterrupt(), 'interrupted', 'It was interrupted: asked for by Ctrl-C'),
        pytest.param(
            EndoscopeError('timed out'),
            'failed',
            'It could not go on: timed out.',
            marks=pytest.mark.nightly,
        ),
    ],
)
def test_what_breaks_off_loses_nothing_and_is_called_what_it_was(
    both, stribeck_case, error, stopped, words
):
    def interrupted(motion, file, bag):
        if bag.name == 'bag_2':
            raise error
        bag.mkdir()

    with pytest.raises(type(error)):
        investigate(
            both,
            interrupted,
            lambda bags, known: stribeck_case,
            page=lambda log: index_page.page(log, both.folder),
        )
    kept = log_of(both.folder)
    assert kept['stopped'] == stopped
    assert kept['rounds'][0]['answer']['names'][0]['id'] == 'stribeck_friction'
    assert kept['rounds'][0]['answer']['places']
    assert kept['rounds'][1]['ended'].startswith(words)
    assert begun(both.folder, both.plant_file).rounds[1].ended.startswith(words)
    html = (both.folder / PAGE).read_text()
    assert words in html
    assert 'solid var(--finding)' in html
    assert f'Next: <code>endoscope operate adopt {both.folder / PLANT}' in html
    assert f'endoscope {version("endoscope_explain")}' in html


def test_numbers_that_an_effect_may_stand_for_are_left_open(both, certain, monkeypatch):
    monkeypatch.setattr(prediction_set, 'MASS', 1.0)
    tried = Contest((('other numbers',), ('gravity', 'load_of_angle')), (9.0, 9.0), 5.0, False)
    found = {'effects': (), 'verdict': Verdict.PARAMETERS_DIFFER}
    explanation = dataclasses.replace(certain.explanation, contests={'bend_x': tried}, **found)
    left_open = dataclasses.replace(certain, explanation=explanation, **found)
    both = dataclasses.replace(both, experiments=0)
    log = investigate(both, no_rig, lambda bags, known: left_open)
    (name,) = log.last_answer.names
    assert (name.id, name.joint, name.rivals) == ('other numbers', 'bend_x', tried.names[1])
    assert log.stopped is not Stop.ONE_CLASS


def test_a_comparison_that_nobody_wants_leaves_what_is_known(both, certain):
    asked = []

    def declined(motion, file, bag, plant):
        asked.append((motion.words, file.name, plant))
        raise NotPlayedError('the motion was not wanted')

    log = investigate(both, no_rig, lambda bags, known: certain, track=declined)
    assert log.stopped is Stop.ONE_CLASS
    assert log.untracked == 'the motion was not wanted'
    ((words, file, plant),) = asked
    assert file == 'held_out.csv'
    assert 'Held-out motion of bend_x and bend_y, 20 s' in words
    assert plant == both.plant_file
    assert 'not measured: the motion was not wanted' in (both.folder / LOG_MD).read_text()


def test_what_is_at_its_end_is_not_begun_again(both, certain):
    assert investigate(both, no_rig, lambda bags, known: certain).stopped is Stop.ONE_CLASS
    with pytest.raises(InputError, match='at its end: One explanation is left'):
        begun(both.folder, both.plant_file)


def test_a_folder_is_one_programs_until_that_is_gone(both, stribeck_case):
    left = partial(is_left_behind, both.folder / 'bag_1')
    elsewhere = both.folder.parent
    assert not left(elsewhere)
    log = investigate(
        dataclasses.replace(both, experiments=0), no_rig, lambda bags, known: stribeck_case
    )
    with held(both.folder):
        with pytest.raises(InputError, match='another program investigates'), held(both.folder):
            pass
        assert not left(elsewhere)
        # It holds this one itself.
        assert left(both.folder)
    assert left(elsewhere)
    dataclasses.replace(log.with_last(recorded=False), stopped=None).write(both.folder)
    ended = begun(both.folder, both.plant_file).rounds[-1].ended
    assert ended.startswith('the program was killed')


def test_another_plant_or_a_folder_of_something_else_is_refused(both, tmp_path, stribeck_case):
    with pytest.raises(InputError, match='holds no investigation'):
        begun(tmp_path, both.plant_file)
    dropped = dataclasses.replace(both, experiments=0)
    investigate(dropped, no_rig, lambda bags, known: stribeck_case)
    save_plant(ONE, both.plant_file)
    with pytest.raises(InputError, match='another plant'):
        begun(both.folder, both.plant_file)


@pytest.mark.parametrize('first', [calibration, commissioning])
def test_motions_of_its_own_keep_to_the_limits_of_the_rig(first):
    slow = dataclasses.replace(RIG, joints=dataclasses.replace(RIG.joints, reach=0.6, speed=2.0))
    motion = first(PlantDescription(), slow)
    require_allowed(motion, slow)
    assert motion.largest <= 0.6
    with pytest.raises(MotionRefusedError, match='largest angle is'):
        require_allowed(first(PlantDescription(), RIG), slow)


def test_the_calibration_bends_every_joint_to_both_sides():
    motion = calibration(PlantDescription(), RIG)
    angle = motion.table.angle
    assert motion.duration == pytest.approx(11.0, abs=0.1)  # with a rest
    assert np.abs(angle[[0, -1]]).max() < 1e-4
    assert angle.max(axis=0) == pytest.approx(0.5 * np.pi, rel=1e-3)
    assert angle.min(axis=0) == pytest.approx(-0.5 * np.pi, rel=1e-3)


def test_what_the_calibration_leaves_without_a_name_is_looked_at_in_the_commissioning_motion(
    both, certain
):
    found = {'effects': (), 'verdict': Verdict.UNKNOWN_PHYSICS}
    explanation = dataclasses.replace(certain.explanation, **found)
    unnamed = dataclasses.replace(certain, explanation=explanation, **found)
    log = investigate(both, no_rig, lambda bags, known: unnamed)
    assert [each.motion for each in log.rounds] == ['calibration', 'commissioning']
    assert log.stopped is Stop.ONE_CLASS
    assert 'has no name' in log.words


def test_what_no_short_motion_decides_is_looked_at_in_the_commissioning_motion(both, stribeck_case):
    # Where the tip was never seen, nothing says how far a motion may go.
    bending = stribeck_case.recording.bending
    unseen = stribeck_case.recording.with_series(
        {'bending': dataclasses.replace(bending, valid=np.zeros_like(bending.valid))}
    )
    audit = dataclasses.replace(stribeck_case.inputs.audit, recording=unseen)
    inputs = dataclasses.replace(stribeck_case.inputs, audit=audit)
    case = dataclasses.replace(stribeck_case, inputs=inputs)
    both = dataclasses.replace(both, experiments=4)
    log = investigate(both, no_rig, lambda bags, known: case)
    assert [each.motion for each in log.rounds] == ['calibration', 'commissioning']
    assert log.stopped is Stop.NOTHING_TO_GAIN
    assert 'confounded with viscous_friction' in log.words


def test_a_rig_whose_improved_plant_is_too_tight_is_not_commissioned(both, certain):
    tight = dataclasses.replace(JointParameters(), pretension=100.0)
    found = {'effects': (), 'verdict': Verdict.UNKNOWN_PHYSICS}
    explanation = dataclasses.replace(certain.explanation, **found)
    plant = PlantDescription(dict.fromkeys(JOINTS, tight))
    unnamed = dataclasses.replace(certain, explanation=explanation, plant=plant, **found)
    log = investigate(both, no_rig, lambda bags, known: unnamed)
    assert [each.motion for each in log.rounds] == ['calibration']
    assert log.stopped is Stop.NOTHING_TO_GAIN
    assert 'But the commissioning motion is refused' in log.words


@pytest.mark.parametrize('joint', [0, 1])
def test_the_commissioning_motion_makes_wide_strokes_again_in_its_second_half(joint):
    table = commissioning(PlantDescription(), RIG).table
    every = np.arange(0.0, table.time[-1], TICK)
    command = np.interp(every, table.time, table.angle[:, joint])
    wide = [each for each in strokes(command) if abs(each.end - each.start) > 2.4]
    assert [np.sign(each.end - each.start) for each in wide] == [-1.0, 1.0, -1.0, 1.0]
    assert all(each.twice for each in wide)
    assert once_only('bend_x', strokes(command)) == ''
    # A hold is seen again for as long as it lasts, and judges no branch.
    seen = seen_before(command)
    moment = np.arange(len(seen)) * EVERY_S
    moves = np.abs(np.gradient(np.interp(moment, every, command), EVERY_S)) > 0.05
    assert np.mean(seen & moves & (moment > 0.5 * every[-1])) > LEAST_SHARE


def test_a_rig_that_the_plant_answers_with_too_much_tension_is_not_moved():
    tension = dataclasses.replace(RIG.tension, calibration_ceiling=5.0)
    weak = dataclasses.replace(RIG, tension=tension)
    with pytest.raises(MotionRefusedError, match=r'calibration motion is refused.*more than 5 N'):
        calibration(PlantDescription(), weak)


def test_a_motion_that_is_too_fast_is_refused():
    time = np.array([0.0, 1.0, 1.1, 2.0])
    angle = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 0.0]])
    motion = RigMotion('jump', 'bend_x', '', CommandTable(JOINTS, time, angle))
    with pytest.raises(MotionRefusedError, match='speed is 10 rad/s'):
        require_allowed(motion, RIG)
