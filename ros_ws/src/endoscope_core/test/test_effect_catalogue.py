"""What every effect of the catalogue has in common: names, vanishing, place, smoothness."""

import math
import re

import numpy as np
import pytest

from endoscope_core.effects import CATALOGUE, Stage, UnknownEffectError, describe
from endoscope_core.plant import EffectSpec, PlantDescription, simulate
from endoscope_core.plant.packing import effect_values, pack

COMPARABLE = {
    'transport_delay': ('delay_s',),
    'actuator_lag': ('time_constant_s',),
    'rate_limit': ('limit_rad_per_s',),
    'torque_limit': (),
    'gear_backlash': ('gap_rad',),
    'cogging': (),
    'wire_slack': (),
    'pretension_loss': ('rate_n_per_s',),
    'stribeck_friction': (),
    'viscous_friction': (),
    'wire_stiffening': (),
    'wire_creep': (),
    'configuration_change': ('time_s',),
    'friction_asymmetry': (),
    'friction_run_in': (),
    'distributed_friction': (),
    'presliding_shape': (),
    'joint_backlash': ('gap_rad',),
    'joint_stop': ('angle_rad',),
    'contact': ('angle_rad',),
    'gravity': (),
    'external_load': ('moment_nm', 'time_s'),
    'joint_inertia': (),
    'cross_coupling': (),
    'breathing': ('frequency_hz',),
    'tracker_bias': ('bias_rad',),
    'tracker_distortion': (),
    'tracker_delay': ('delay_s',),
    'tracker_drift': ('rate_rad_per_s',),
    'tracker_outliers': (),
    'load_cell_drift': ('rate_n_per_s',),
    'load_cell_gain': ('gain',),
    'load_cell_crosstalk': (),
    'load_cell_saturation': ('limit_n',),
    'clock_skew': ('skew',),
    'recording_gap': ('time_s',),
}
OF_THE_RECORDING = ('tracker_outliers', 'clock_skew', 'recording_gap')
IN_THE_PLANT = [effect_id for effect_id in COMPARABLE if effect_id not in OF_THE_RECORDING]
TIME = 1e-3 * np.arange(2500)
COMMAND = 0.5 * np.column_stack(
    [
        np.deg2rad(85.0) * np.sin(3.0 * TIME),
        np.deg2rad(60.0) * np.sin(2.0 * TIME + 1.0) - np.deg2rad(60.0) * np.sin(1.0),
    ]
)
CHANNELS = ('shaft_position', 'shaft_velocity', 'shaft_effort', 'tension', 'bending')
# Beginning within the 2.5 s that are simulated here.
EARLY = {'configuration_change': {'time_s': 1.0}, 'external_load': {'time_s': 1.0}}


@pytest.fixture(scope='module')
def nominal():
    return simulate(PlantDescription(), COMMAND)


def with_effect(effect_id, parameters=None, joint='bend_x'):
    given = {**EARLY.get(effect_id, {}), **(parameters or {})}
    return simulate(PlantDescription(effects=(EffectSpec(effect_id, joint, given),)), COMMAND)


def changed_channels(trajectory, reference, joint):
    return {
        name
        for name in CHANNELS
        if np.abs(getattr(trajectory, name)[:, joint] - getattr(reference, name)[:, joint]).max()
        > 1e-9
    }


def test_has_every_effect_with_its_comparable_parameters():
    assert {
        effect_id: tuple(p.name for p in definition.parameters if p.comparable)
        for effect_id, definition in CATALOGUE.items()
    } == COMPARABLE


@pytest.mark.parametrize('effect_id', COMPARABLE)
def test_is_described(effect_id):
    definition = describe(effect_id)
    assert definition.id == effect_id
    assert definition.physics.endswith('.')
    assert definition.equation
    assert re.search(r'\d{4}', definition.source), 'a source has a year or a standard a number'
    assert 1 <= len(definition.parameters) <= 6
    assert any(math.isfinite(p.off) for p in definition.parameters)
    for parameter in definition.parameters:
        for value in (parameter.typical, *parameter.starts, *parameter.choices):
            assert parameter.low <= value <= parameter.high
        if math.isfinite(parameter.off):
            assert parameter.low <= parameter.off <= parameter.high


def test_an_unknown_effect_is_named_with_the_nearest():
    with pytest.raises(UnknownEffectError, match=r'stribek_friction.*stribeck_friction'):
        describe('stribek_friction')
    with pytest.raises(UnknownEffectError, match=r'no parameter rize: did you mean rise'):
        effect_values(EffectSpec('stribeck_friction', 'bend_x', {'rize': 1.0}))
    with pytest.raises(UnknownEffectError, match=r'joint bend_z: did you mean bend_'):
        pack(PlantDescription(effects=(EffectSpec('gravity', 'bend_z'),)))


@pytest.mark.parametrize('value', [-0.1, 0.6, math.nan])
def test_a_parameter_out_of_bounds_is_named(value):
    with pytest.raises(ValueError, match=r'transport_delay: delay_s is .* between 0 and 0\.5 s'):
        effect_values(EffectSpec('transport_delay', 'bend_x', {'delay_s': value}))


@pytest.mark.parametrize(('nodes', 'wrong'), [(2.5, 'a whole number'), (13, 'between 2 and 12')])
def test_a_count_is_a_whole_number_within_its_bounds(nodes, wrong):
    with pytest.raises(ValueError, match=f'distributed_friction: nodes is {nodes:g}.*{wrong}'):
        effect_values(EffectSpec('distributed_friction', 'bend_x', {'nodes': nodes}))


def test_an_effect_given_twice_on_a_joint_is_refused():
    twice = (EffectSpec('gravity', 'bend_x'), EffectSpec('gravity', 'bend_x'))
    with pytest.raises(ValueError, match='gravity is given twice on joint bend_x'):
        pack(PlantDescription(effects=twice))


@pytest.mark.parametrize('effect_id', COMPARABLE)
def test_vanishes_at_its_off_value(effect_id, nominal):
    off = {p.name: p.off for p in CATALOGUE[effect_id].parameters if math.isfinite(p.off)}
    trajectory = with_effect(effect_id, off)
    for name in CHANNELS:
        np.testing.assert_allclose(
            getattr(trajectory, name), getattr(nominal, name), rtol=0.0, atol=1e-9
        )


@pytest.mark.parametrize('effect_id', IN_THE_PLANT)
def test_changes_what_lies_downstream_and_nothing_else(effect_id, nominal):
    physics = {'shaft_effort', 'tension', 'bending'}
    expected = {
        Stage.ACTUATOR: {*CHANNELS},
        Stage.TRANSMISSION: physics,
        Stage.JOINT: physics,
    }.get(CATALOGUE[effect_id].stage)
    if effect_id in ('gear_backlash', 'cogging'):
        expected = physics  # they act behind the encoder
    elif effect_id == 'joint_backlash' or effect_id.startswith('tracker'):
        expected = {'bending'}
    elif effect_id.startswith('load_cell'):
        expected = {'tension'}
    trajectory = with_effect(effect_id)
    assert changed_channels(trajectory, nominal, 0) == expected
    assert changed_channels(trajectory, nominal, 1) == set()


@pytest.mark.parametrize('effect_id', OF_THE_RECORDING)
def test_faults_of_the_recording_leave_the_rig_alone(effect_id, nominal):
    assert changed_channels(with_effect(effect_id), nominal, 0) == set()


ONLY_WITH = {
    'memory_s': {'lagging': 1.0},
    'flank_compliance': {'loaded_tip': 1.0},
    'wire_end_damping': {'loaded_tip': 1.0},
    'sharpness': {'dead_zone_m': 5e-4},
    'span_s': {'time_constant_s': 20.0},
}
"""What other parameters have to be for one to have anything to act on."""
JUDGED_AT = {
    ('gear_backlash', 'flank_spread'): 0.15,
    ('stribeck_friction', 'memory_s'): 1e-2,
    ('configuration_change', 'duration_s'): 0.05,
    ('external_load', 'duration_s'): 0.05,
    ('pretension_loss', 'time_constant_s'): 20.0,
}
"""Where parameters are judged that have no slope at their typical value, or a rugged one."""


def slopes(effect_id, parameter, step):
    """Readings' slopes, in sensors' noise, by a parameter where a fit of the effect begins."""
    start = {
        p.name: p.starts[0]
        for p in CATALOGUE[effect_id].parameters
        if p.typical == 0.0 and p.starts and p is not parameter
    }
    if parameter.name in ONLY_WITH:
        start |= ONLY_WITH[parameter.name]
    typical = JUDGED_AT.get((effect_id, parameter.name), parameter.typical)
    unit = abs(typical) or 0.1 * (parameter.high - parameter.low)
    sign = 1.0 if typical + step * unit <= parameter.high else -1.0
    here, there = (
        with_effect(effect_id, start | {parameter.name: typical + shift})
        for shift in (0.0, sign * step * unit)
    )
    return (
        np.concatenate(
            [
                ((there.tension - here.tension)[:, 0] / 0.02).ravel(),
                (there.bending - here.bending)[:, 0] / 0.00436,
            ]
        )
        / step
    )


@pytest.mark.parametrize(
    ('effect_id', 'name'),
    [
        (effect_id, p.name)
        for effect_id in IN_THE_PLANT
        for p in CATALOGUE[effect_id].parameters
        if not (p.choices or p.counted) and p.name != 'time_s'
    ],
)
def test_readings_have_a_slope_by_every_parameter(effect_id, name):
    parameter = next(p for p in CATALOGUE[effect_id].parameters if p.name == name)
    coarse, fine = (slopes(effect_id, parameter, step) for step in (1e-3, 1e-4))
    assert np.linalg.norm(fine) > 0.0
    assert np.linalg.norm(fine - coarse) < 0.2 * np.linalg.norm(fine)


@pytest.mark.parametrize('effect_id', EARLY)
def test_an_onset_moves_continuously(effect_id, nominal):
    def excess(time):
        return (with_effect(effect_id, {'time_s': time}).tension - nominal.tension).sum()

    early, middle, late = (excess(time) for time in (1.0, 1.0002, 1.0004))
    assert early != middle
    assert middle - early == pytest.approx(late - middle, rel=0.25)
