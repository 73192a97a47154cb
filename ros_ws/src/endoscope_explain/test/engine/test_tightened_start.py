"""Friction that tightening the wires left at the start of a recording."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.physics.layout import OUT_TENSION_A, OUT_TENSION_B
from endoscope_explain.compose import nominal_anchors
from endoscope_explain.conclusions import start_friction
from endoscope_explain.evaluate import packed_joint
from endoscope_explain.observation import observe
from endoscope_explain.predicted_signals import simulate_rig, view
from endoscope_explain.score import misfit

HELD = 0.8


def begun_tightened(recording, plant, share):
    """What the sensors of a plant would have read had friction held its wires at the start."""
    held = replace(recording, start_friction={'bend_x': share})
    (observation,) = observe(held, plant)
    outputs = simulate_rig((observation,), plant)[0]
    chance = np.random.default_rng(3)
    channels = tuple(
        replace(c, value=c.predicted(outputs) + c.noise * chance.standard_normal(len(c.time)))
        for c in observation.channels
    )
    return replace(observation, channels=channels, start_friction=0.0)


@pytest.fixture
def observation(one_joint):
    plant = one_joint.rig()
    return begun_tightened(one_joint.record(plant, one_joint.motion()), plant, HELD)


def test_a_tightened_wire_is_read_tighter_by_the_capstan_at_rest(one_joint):
    plant = one_joint.rig()
    recording = one_joint.record(plant, one_joint.motion())
    seen = [
        view(replace(recording, start_friction={'bend_x': share}), {'plant': plant})
        for share in (0.0, 1.0)
    ]
    for wire in ('wire_x_pos', 'wire_x_neg'):
        free, held = (v.signals[f'wires/measured_js:{wire}'].predicted['plant'] for v in seen)
        # Held from the motor's side, the proximal tension is larger than the middle one.
        assert held[-1] == pytest.approx(free[-1], abs=1e-3)
        assert held[0] > 1.05 * free[0]


def test_what_is_held_is_read_from_the_first_sample_on(one_joint):
    plant = one_joint.rig()
    resting = one_joint.record(plant, np.zeros(200))
    (observation,) = observe(replace(resting, start_friction={'bend_x': HELD}), plant)
    outputs = simulate_rig((observation,), plant)[0]
    joint = plant.joints['bend_x']
    held = joint.pretension * np.exp(0.5 * joint.capstan_exponent * HELD)
    np.testing.assert_allclose(outputs[:, [OUT_TENSION_A, OUT_TENSION_B]], held, rtol=1e-9)


def test_how_much_it_was_is_found_where_it_is_asked_for(one_joint, observation):
    plant = packed_joint(one_joint.rig(), 'bend_x')
    nominal, _ = nominal_anchors(observation, *plant)
    tightened, _ = nominal_anchors(observation, *plant, tightened=True)
    assert start_friction(nominal) == 0.0
    assert start_friction(tightened) == pytest.approx(HELD, abs=0.02)
    assert misfit(tightened).channels.max() < 1.1 < misfit(nominal).channels.max()
    assert START_FRICTION not in {item.index for item in nominal.model.free}
