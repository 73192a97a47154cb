import dataclasses

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec, PlantDescription
from endoscope_core.rig import shipped_rig
from endoscope_explain.design import (
    imagine,
    is_safe,
    left_over,
    propose,
    propose_beside_numbers,
)
from endoscope_explain.experiment_motions import family
from endoscope_explain.explanation import NamedEffect
from endoscope_explain.prediction_set import OTHER_NUMBERS

PLANT = PlantDescription()
RIVALLED = NamedEffect('transport_delay', 'bend_x', {}, ('actuator_lag',))


def with_effect(effect_id, **parameters):
    return dataclasses.replace(PLANT, effects=(EffectSpec(effect_id, 'bend_x', parameters),))


def distance(truth, rival, joint):
    return np.sqrt(np.mean(left_over(truth, rival, joint) ** 2))


@pytest.fixture(scope='module')
def motions():
    return {w.name: w for w in family('bend_x', ('bend_y',), 1.0)}


def test_every_motion_starts_and_ends_at_rest_and_within_reach(motions):
    for waveform in motions.values():
        assert waveform.angle[0] == pytest.approx(0.0, abs=1e-9)
        assert waveform.angle[-1] == pytest.approx(0.0, abs=1e-9)
        assert np.abs(waveform.angle).max() <= 1.0 + 1e-9
        assert np.abs(np.diff(waveform.angle)).max() < 0.2


def test_a_plant_is_no_distance_from_itself(motions):
    truth = imagine(PLANT, motions['fast and slow'], shipped_rig())
    assert distance(truth, PLANT, 'bend_x') < 0.05


def test_delay_and_lag_part_in_quick_moves_and_not_in_slow_ones(motions):
    late, lagging = with_effect('transport_delay', delay_s=0.03), with_effect('actuator_lag')
    apart = {
        name: distance(imagine(late, motions[name], shipped_rig()), lagging, 'bend_x')
        for name in ('steps with holds', 'slow ramps')
    }
    assert apart['steps with holds'] > 3.0 * apart['slow ramps']


def test_a_motion_beyond_what_the_rig_has_been_through_is_not_safe(motions):
    answer = imagine(PLANT, motions['slow ramps'], shipped_rig())
    most, widest = answer.tension.values.max(), np.abs(answer.bending.values).max()
    assert is_safe(answer, most, widest)
    assert not is_safe(answer, 0.99 * most, widest)
    assert not is_safe(answer, most, 0.99 * widest)


def test_the_proposal_names_its_rivals_and_the_best_motion(record):
    plant = with_effect('transport_delay', delay_s=0.03)
    recording = record(plant, duration=6.0)
    proposed = propose(recording, plant, RIVALLED)
    assert proposed.separates == ('transport_delay', 'actuator_lag')
    assert proposed.distances[proposed.waveform] == max(proposed.distances.values())
    assert proposed.joints == ('bend_x', 'bend_y')
    command = np.array(proposed.command)
    assert command.shape == (len(proposed.time), 2)
    assert not command[:, 1].any()


def test_where_no_motion_is_safe_none_is_proposed(record):
    plant = with_effect('transport_delay', delay_s=0.03)
    recording = record(plant, duration=6.0)
    weak = dataclasses.replace(recording.tension, values=0.2 * recording.tension.values)
    assert propose(dataclasses.replace(recording, tension=weak), plant, RIVALLED) is None


def test_without_a_rival_there_is_nothing_to_separate(record):
    effect = NamedEffect('transport_delay', 'bend_x', {})
    plant = with_effect('transport_delay')
    assert propose(record(plant, duration=3.0), plant, effect) is None


def test_a_rival_that_is_there_besides_is_none(record):
    late = EffectSpec('transport_delay', 'bend_x', {'delay_s': 0.03})
    lag = EffectSpec('actuator_lag', 'bend_x', {'time_constant_s': 0.02})
    plant = dataclasses.replace(PLANT, effects=(late, lag))
    assert propose(record(plant, duration=8.0), plant, RIVALLED) is None


def test_other_numbers_are_a_rival_of_an_effect(record):
    recording = record(with_effect('transport_delay', delay_s=0.03), duration=6.0)
    joint = dataclasses.replace(PLANT.joints['bend_x'], joint_friction=0.02)
    others = dataclasses.replace(PLANT, joints={**PLANT.joints, 'bend_x': joint})
    proposed = propose_beside_numbers(recording, others, PLANT, 'bend_x', ('transport_delay',))
    assert proposed.separates == (OTHER_NUMBERS, 'transport_delay')
    # A function at a place has no formula to simulate it by.
    assert propose_beside_numbers(recording, others, PLANT, 'bend_x', ('load_of_angle',)) is None
