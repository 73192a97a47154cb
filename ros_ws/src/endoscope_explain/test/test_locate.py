import dataclasses

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec, PlantDescription, TermSpec
from endoscope_explain.explanation import Estimate, Explanation, NamedEffect, Verdict
from endoscope_explain.locate.excess import information
from endoscope_explain.locate.locating import cut_at_motor, locate_effects, locate_unknown

PLANT = PlantDescription()


def located(record, effect_id, joint='bend_x', **parameters):
    spec = EffectSpec(effect_id, joint, parameters)
    plant = dataclasses.replace(PLANT, effects=(spec,))
    recording = record(plant, duration=15.0)
    effect = NamedEffect(
        effect_id, joint, {k: Estimate(v, v, v, '-') for k, v in parameters.items()}
    )
    (place,) = locate_effects(recording, plant, [effect])
    return place


def test_a_wrong_cell_shows_in_its_own_wire_alone(record):
    place = located(record, 'load_cell_gain', gain=1.2, wire=1.0)
    assert place.signals == ('wires/measured_js:wire_x_neg',)
    assert place.stage == 'sensing'


def test_an_effect_shows_where_the_function_does_by_which_the_plant_has_it(record):
    term = TermSpec('bend_x', 'tracker_of_time', '0.05 * sin(1.0 * t)')
    plant = dataclasses.replace(PLANT, terms=(term,))
    (place,) = locate_effects(
        record(plant, duration=15.0), plant, [NamedEffect('tracker_drift', 'bend_x', {})]
    )
    assert place.signals == ('slave/measured_js:bend_x',)
    assert place.intervals


def test_an_effect_that_is_a_function_of_two_states_goes_with_its_factor(record):
    law = TermSpec('bend_x', 'tracker_of_time', '0.05 * sin(1.0 * t)')
    factor = TermSpec('bend_x', 'tracker_of_angle', '0.3 * q', multiplies=True)
    plant = dataclasses.replace(PLANT, terms=(law, factor))
    (place,) = locate_effects(
        record(plant, duration=15.0), plant, [NamedEffect('tracker_drift', 'bend_x', {})]
    )
    assert place.signals == ('slave/measured_js:bend_x',)


def test_a_stop_shows_beyond_its_angle(record):
    place = located(record, 'joint_stop', angle_rad=0.15)
    assert place.regime.startswith(('beyond', 'above', 'below'))
    degrees = float(place.regime.split()[1].strip('+-'))
    assert 3 <= degrees <= 15
    assert set(place.signals) >= {'wires/measured_js:wire_x_pos', 'wires/measured_js:wire_x_neg'}


def test_a_trace_is_found_on_the_joint_that_has_it(record):
    place = located(record, 'load_cell_gain', 'bend_y', gain=1.2)
    assert place.joint == 'bend_y'
    assert all('_y' in signal for signal in place.signals)


def test_what_begins_is_said_to_begin(record):
    place = located(record, 'configuration_change', time_s=8.0, factor=1.6)
    assert place.onset_s == 8.0
    assert place.regime.startswith('from 8.0 s on')
    assert min(a for a, _ in place.intervals) >= 7.75


def test_a_slow_drift_is_slow_and_breathing_is_not(record):
    drift = located(record, 'tracker_drift', rate_rad_per_s=0.01)
    breathing = located(record, 'breathing', frequency_hz=1.5, moment_nm=0.0006)
    assert drift.band_hz[1] < 0.5
    assert breathing.band_hz[1] >= 1.4


def test_where_nothing_is_missing_no_interval_stands_out(record):
    place = located(record, 'tracker_bias', bias_rad=0.0)
    assert place.intervals == ()
    assert place.onset_s is None


def test_information_is_zero_for_a_state_that_tells_nothing():
    energy = np.ones(1000)
    active = np.arange(1000) % 2 == 0
    assert information(energy, active, np.ones(1000, bool)) == pytest.approx(0.0, abs=1e-9)
    energy[~active] = 0.0
    assert information(energy, active, np.ones(1000, bool)) == pytest.approx(np.log(2), rel=1e-3)


@pytest.mark.parametrize(
    ('effect', 'before'),
    [
        (EffectSpec('transport_delay', 'bend_x', {'delay_s': 0.04}), True),
        (EffectSpec('joint_stop', 'bend_x', {'angle_rad': 0.1}), False),
    ],
)
def test_cutting_the_chain_at_the_motor_tells_on_which_side_the_fault_is(record, effect, before):
    recording = record(dataclasses.replace(PLANT, effects=(effect,)), duration=10.0)
    cut = next(c for c in cut_at_motor(recording, PLANT) if c.joint == 'bend_x')
    assert cut.by_command > 3.0
    assert cut.before_the_motor is before


def test_without_a_recorded_shaft_there_is_no_cut(record):
    recording = record(duration=3.0)
    assert cut_at_motor(recording.with_series({'shaft_position': None}), PLANT) == ()


def test_what_nothing_explains_is_where_the_misfit_begins_along_the_chain(record):
    gain = EffectSpec('load_cell_gain', 'bend_x', {'gain': 1.3})
    stop = EffectSpec('joint_stop', 'bend_x', {'angle_rad': 0.1})
    lag = EffectSpec('actuator_lag', 'bend_x', {'time_constant_s': 0.2})
    for effect, stage in ((gain, 'sensing'), (stop, 'joint'), (lag, 'actuator')):
        recording = record(dataclasses.replace(PLANT, effects=(effect,)), duration=8.0)
        explanation = Explanation.without_fit(Verdict.UNKNOWN_PHYSICS, PLANT)
        (place,) = locate_unknown(recording, explanation)
        assert (place.stage, place.joint) == (stage, 'bend_x')
