from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from endoscope_core.control import (
    Feedforward,
    FeedforwardLaw,
    PhysicalInverse,
    PhysicalInverseSettings,
    PhysicalParameters,
    PlantLearning,
)
from endoscope_core.control.physical_inverse import InternalModel
from endoscope_core.control.physical_inverse_law import (
    distance_to_reversal,
    equilibrium_stretch,
    reserve,
)
from endoscope_core.dataset.rig_variation import in_tube, random_rig
from endoscope_core.plant import EffectSpec, JointParameters
from endoscope_core.signals import non_periodic_signal, periodic_signal
from endoscope_core.trials.tracking_trial import run_tracking_trial

TICK = 1e-3
JOINT = PhysicalParameters(JointParameters(capstan_exponent=1.3))


def follow(share, signal, joint=JOINT):
    """Tip angles when the inverse drives the very plant that it inverts."""
    inverse = PhysicalInverse(joint, PhysicalInverseSettings(share=share))
    rig = InternalModel(joint, 0.0, 0.0, 0.0)
    time = np.arange(0.0, signal.steady[1], TICK)
    angle, velocity = signal(time)
    inverse.begin(0.0, 0.0, 0.0, 0.0)
    tips = np.empty(time.size)
    for k in range(time.size):
        command = inverse.wanted(angle[k], velocity[k], TICK)
        inverse.sent(command, TICK)
        rig.advance(command, TICK)
        tips[k] = rig.tip
    inside = time >= signal.steady[0]
    return np.rad2deg(tips - angle)[inside]


@pytest.mark.parametrize(('exponent', 'evenness'), [(0.3, 0.0), (1.5, 0.0), (0.8, 0.6), (1.5, 1.0)])
@pytest.mark.parametrize('sense', [1.0, -1.0])
def test_the_plant_slowly_driven_is_in_the_balance_that_the_law_computes(exponent, evenness, sense):
    joint = PhysicalParameters(JointParameters(capstan_exponent=exponent), evenness)
    model = InternalModel(joint, 0.0, 0.0, 0.0)
    for k in range(4000):
        model.advance(sense * 1.6 * k / 4000.0, TICK)
    stretch = equilibrium_stretch(model.packed, model.tip, sense * 0.4, sense, sense)
    lag = 0.4 * 2.0 * 0.9 / 60.0
    assert sense * 1.6 - sense * lag - model.tip == pytest.approx(stretch, abs=0.01)


def test_letting_the_friction_release_before_the_turning_point_shrinks_the_kick():
    signal = periodic_signal(3.2 * np.pi)
    crossing, releasing = follow(0.0, signal), follow(0.9, signal)
    assert np.max(np.abs(crossing)) > 12.0
    assert np.max(np.abs(releasing)) < 0.6 * np.max(np.abs(crossing))
    assert np.std(releasing) < 0.6 * np.std(crossing)


def test_motion_that_slows_down_but_does_not_turn_is_followed_all_the_same():
    time = np.arange(0.0, 6.0, TICK)
    speed = 0.35 + 0.3 * np.cos(2.0 * np.pi * time / 3.0)
    angle = np.cumsum(speed) * TICK - 1.0
    inverse, rig = PhysicalInverse(JOINT), InternalModel(JOINT, -1.0, -1.0, 1.0)
    inverse.begin(1.0, -1.0, speed[0], -1.0)
    errors = []
    for k in range(time.size):
        command = inverse.wanted(angle[k], speed[k], TICK)
        inverse.sent(command, TICK)
        rig.advance(command, TICK)
        errors.append(rig.tip - angle[k])
    assert np.sqrt(np.mean(np.square(errors[1000:]))) < np.deg2rad(4.0)


def test_reserve_is_what_the_release_carries():
    packed = InternalModel(JOINT, 0.0, 0.0, 0.0).packed
    dead_zone = equilibrium_stretch(packed, 0.5, 0.0, 1.0, 1.0) - equilibrium_stretch(
        packed, 0.5, 0.0, -1.0, 1.0
    )
    assert 0.25 * dead_zone < reserve(packed, 0.5, 1.0, 1.0) < 0.5 * dead_zone
    assert reserve(packed, 0.5, -1.0, 1.0) == 0.0


@given(st.floats(0.25, 2.9), st.floats(0.1, 2.0), st.floats(0.05, 1.5))
def test_the_turning_point_of_a_harmonic_is_foreseen(omega, amplitude, phase):
    way = distance_to_reversal(
        amplitude * omega * np.cos(phase),
        -amplitude * omega**2 * np.sin(phase),
        -amplitude * omega**3 * np.cos(phase),
    )
    assert way == pytest.approx(amplitude * (1.0 - np.sin(phase)), rel=1e-6)
    assert distance_to_reversal(1.0, 0.5, 0.0) == np.inf


@given(st.lists(st.tuples(st.floats(-1.7, 1.7), st.floats(-20.0, 20.0)), min_size=1, max_size=60))
@settings(max_examples=30)
def test_whatever_is_desired_the_command_is_finite_and_its_speed_bounded(desired):
    feedforward = Feedforward(1)
    feedforward.select(FeedforwardLaw('physical', (JOINT,)))
    last = None
    for angle, velocity in desired:
        command = feedforward.step([angle], [velocity], TICK)[0]
        assert np.isfinite(command)
        if last is not None:
            assert abs(command - last) <= feedforward.settings.speed_limit * TICK + 1e-12
        last = command


def test_modes_change_while_it_moves_without_a_jump():
    feedforward = Feedforward(1)
    physical = FeedforwardLaw('physical', (JOINT,))
    learning = FeedforwardLaw('adaptive_physical', (JOINT,))
    commands = []
    for k in range(6000):
        for when, law in ((1000, physical), (2500, learning), (4000, FeedforwardLaw())):
            if k == when:
                feedforward.select(law)
        time = k * TICK
        commands.append(feedforward.step([np.sin(time)], [np.cos(time)], TICK)[0])
        if k % 25 == 0:
            feedforward.measure(0.0, [0.8 * np.sin(time)])
    steps = np.abs(np.diff(commands))
    for when in (1000, 2500, 4000):
        assert np.max(steps[when - 3 : when + 3]) < 0.004


def test_a_random_rig_whose_plant_is_known_is_followed():
    plant = in_tube(random_rig(np.random.default_rng(5)), 0.7)
    signal = non_periodic_signal(12.0)
    none = run_tracking_trial(plant, signal, FeedforwardLaw(), False, 0).rmse
    law = FeedforwardLaw('physical', tuple(map(PhysicalParameters, plant.joints.values())))
    assert run_tracking_trial(plant, signal, law, False, 0).rmse < 0.06 * none


def test_after_the_tube_was_bent_it_follows_again_within_a_cycle():
    plant = in_tube(random_rig(np.random.default_rng(6)), 0.6)
    bent = replace(
        plant,
        effects=tuple(
            EffectSpec('configuration_change', joint, {'time_s': 4.0, 'factor': 2.2})
            for joint in plant.joints
        ),
    )
    signal = periodic_signal(4.0 + 4.2 * np.pi)
    nominal = (PhysicalParameters(JointParameters(capstan_exponent=0.6)),) * 2
    none = run_tracking_trial(bent, signal, FeedforwardLaw(), False, 0)
    fixed = run_tracking_trial(bent, signal, FeedforwardLaw('physical', nominal), False, 0)
    learnt = run_tracking_trial(bent, signal, FeedforwardLaw('adaptive_physical', nominal), True, 0)
    late = none.time >= 4.0 + 2.0 * np.pi

    def rms(trial):
        return np.sqrt(np.mean((trial.bending - trial.desired[:, None])[late] ** 2))

    assert rms(fixed) > 0.25 * rms(none)
    assert rms(learnt) < 0.10 * rms(none)


@given(st.lists(st.floats(-30.0, 30.0), min_size=1, max_size=80))
@settings(max_examples=20)
def test_estimates_stay_in_their_bounds_whatever_the_tracker_says(readings):
    model = InternalModel(JOINT, 0.0, 0.0, 0.0)
    learning = PlantLearning(JOINT, model)
    for k, reading in enumerate(readings):
        model.advance(np.sin(0.1 * k), 0.004)
        learning.sent(np.sin(0.1 * k), 0.004)
        found = learning.measured(0.001, reading).joint
        assert 0.019 < found.capstan_exponent < 4.51
        assert 0.6 < found.wire_stiffness / JOINT.joint.wire_stiffness < 1.65
    assert np.all(np.linalg.eigvalsh(learning.covariance) > 0.0)


def test_measurements_at_rest_and_the_first_after_a_silence_move_nothing():
    feedforward = Feedforward(1)
    bent = replace(JOINT, joint=replace(JOINT.joint, capstan_exponent=0.3))
    feedforward.select(FeedforwardLaw('adaptive_physical', (bent,)))
    rig = InternalModel(JOINT, 0.0, 0.0, 0.0)
    before = 0.0
    for k in range(3000):
        time = k * TICK
        command = feedforward.step([np.sin(time)], [np.cos(time)], TICK)[0]
        if k == 2500:
            feedforward.measure(0.0, [rig.tip])
        if k > 2500:
            # As fast as the motion asks for, and half as fast again.
            assert abs(command - before) < 2.0 * TICK
        rig.advance(command, TICK)
        before = command
    assert feedforward.learnt[0] != bent
    rest = [np.sin(2.999)], [0.0], TICK
    commands = []
    for _ in range(2000):
        commands.append(feedforward.step(*rest)[0])
        feedforward.measure(0.0, [rig.tip + 0.1])
    assert np.ptp(commands[1000:]) < 1e-9


def test_settings_out_of_range_are_refused():
    with pytest.raises(ValueError, match='turn_lead'):
        PhysicalInverseSettings(turn_lead=1.0)
    with pytest.raises(ValueError, match='share'):
        PhysicalInverseSettings(share=-0.1)


def test_physics_that_the_model_lacks_does_not_lead_the_learning_astray():
    plant = in_tube(random_rig(np.random.default_rng(8)), 0.8)
    coupled = replace(
        plant, effects=tuple(EffectSpec('cross_coupling', joint) for joint in plant.joints)
    )
    signal = periodic_signal(3.2 * np.pi)
    known = tuple(map(PhysicalParameters, plant.joints.values()))
    fixed = run_tracking_trial(coupled, signal, FeedforwardLaw('physical', known), False, 0)
    learnt = run_tracking_trial(
        coupled, signal, FeedforwardLaw('adaptive_physical', known), True, 0
    )
    assert learnt.rmse < fixed.rmse
