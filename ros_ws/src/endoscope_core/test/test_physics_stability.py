"""The plant stays within its geometry, whatever rig, effects, command and tick."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from physics_rig import ACTING, NOMINAL, run

from endoscope_core.physics.effects import CATALOGUE

BOUNDS = {
    'pretension': (0.0, 15.0),
    'pretension_profile': (-0.5, 1.5),
    'wire_stiffness': (300.0, 20000.0),
    'pulley_radius': (1e-3, 1e-2),
    'joint_radius': (4e-4, 5e-3),
    'capstan_exponent': (0.0, 3.0),
    'joint_stiffness': (5e-4, 0.05),
    'joint_rest_angle': (-0.3, 0.3),
    'joint_friction': (0.0, 0.01),
    'joint_presliding': (1e-3, 0.2),
    'joint_presliding_spread': (0.0, 2.0),
    'section_friction': (0.0, 1.0),
    'section_straight_angle': (-0.3, 0.3),
    'joint_damping': (0.0, 1e-3),
    'motor_bandwidth': (5.0, 300.0),
    'motor_damping_ratio': (0.3, 3.0),
}


@st.composite
def plants(draw):
    plant = {key: draw(st.floats(low, high)) for key, (low, high) in BOUNDS.items()}
    plant['friction_profile'] = draw(st.lists(st.floats(-1.0, 1.0), max_size=4))
    return plant


@st.composite
def effects(draw):
    chosen = {}
    for effect_id in draw(st.lists(st.sampled_from(ACTING), unique=True, max_size=8)):
        values = {}
        for e in CATALOGUE[effect_id].parameters:
            numbers = st.sampled_from(e.choices) if e.choices else st.floats(e.low, e.high)
            values[e.name] = draw(st.sampled_from((e.typical, *e.starts)) | numbers)
        chosen[effect_id] = values
    return chosen


@st.composite
def commands(draw):
    """Shaft command (400,) of jumps, rests and ramps within +-1.6 rad."""
    parts, here = [], 0.0
    for _ in range(8):
        there = draw(st.floats(-1.6, 1.6))
        kind = draw(st.sampled_from(('jump', 'ramp', 'rest')))
        here_after = here if kind == 'rest' else there
        parts.append(np.full(50, there) if kind == 'jump' else np.linspace(here, here_after, 50))
        here = here_after
    return np.concatenate(parts)


def largest_angle(plant, chosen, done):
    """Rad that no wire and no moment can bend the joint beyond, without inertia.

    Further out the pulling wire is slack, and moments alone hold the joint.
    """
    turned = max(np.abs(done.motor).max(), 1.6)
    stretched = plant['pretension'] / plant['wire_stiffness']
    ways = plant['pulley_radius'] * turned
    moments = plant['joint_friction']
    for effect_id, values in chosen.items():
        if effect_id == 'cogging':
            ways += plant['pulley_radius'] * 6.0 * values['amplitude_rad']
        if effect_id == 'gear_backlash':
            ways += plant['pulley_radius'] * values['gap_rad']
        if effect_id == 'wire_geometry':
            ways += 2.0 * plant['pulley_radius'] * (turned + 2.0) ** 2
        if effect_id == 'cross_coupling':
            ways += plant['joint_radius']
        if effect_id in ('wire_stiffening', 'wire_creep', 'pretension_loss'):
            # Softer wires stretch and shrink further.
            stretched += 20.0 * (ways + stretched)
        moments += 2.0 * abs(values.get('moment_nm', 0.0))
        moments += abs(values.get('moment_per_rad', 0.0)) + abs(values.get('moment_per_rad2', 0.0))
    by_wires = (ways + stretched) / plant['joint_radius']
    return abs(plant['joint_rest_angle']) + by_wires + moments / plant['joint_stiffness']


@given(plants(), effects(), commands(), st.sampled_from((5e-4, 1e-3, 2e-3, 5e-3, 1e-2)))
@settings(max_examples=200)
def test_everything_stays_finite_and_within_the_geometry(plant, chosen, command, tick):
    done = run(command, chosen, tick, other=0.5 * np.sign(command), **plant)
    for name in ('motor', 'effort', 'a', 'b', 'bending', 'joint', 'states'):
        assert np.isfinite(getattr(done, name)).all(), name
    if not any(effect_id.startswith('load_cell') for effect_id in chosen):
        assert min(done.a.min(), done.b.min()) >= 0.0
    bound = largest_angle(plant, chosen, done)
    inertia = 3.0 if 'joint_inertia' in chosen else 1.0
    gap = chosen.get('joint_backlash', {}).get('gap_rad', 0.0)
    assert np.abs(done.joint).max() <= 1.01 * inertia * bound + gap


def test_friction_that_holds_everything_leaves_the_joint_to_its_own_moments():
    # A capstan exponent of 41 in all: e^-41 at the joint is less than rounding leaves of a sum.
    chosen = {
        'friction_run_in': {'excess': 3.0, 'distance_m': 0.01, 'tail': 0.0},
        'stribeck_friction': {'rise': 3.0, 'stribeck_speed': 0.001, 'tail': 0.0},
        'friction_asymmetry': {'asymmetry': 0.3},
        'load_independent_friction': {'force_n': 0.5},
        'breathing': {
            'moment_nm': 6e-4, 'frequency_hz': 0.25, 'phase_rad': 0.0, 'second_harmonic': 0.0
        },
    }  # fmt: skip
    done = run(np.full(400, 0.5), chosen, 5e-3, capstan_exponent=2.0, pretension=0.0)
    assert np.isfinite(done.states).all()
    assert np.ptp(done.joint[-200:]) > 1e-3


@given(plants(), commands())
@settings(max_examples=30)
def test_a_rig_that_rests_goes_nowhere(plant, command):
    plant['joint_rest_angle'] = 0.0
    done = run(np.zeros(400), {}, 1e-3, **plant)
    assert np.abs(done.joint).max() < 1e-9
    assert np.ptp(done.a) < 1e-9
    assert set(plant) >= set(NOMINAL)
