"""Laws of the feed-forward in the whole chain, on the simulated rig."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.control import FeedforwardLaw, PhysicalParameters
from endoscope_core.control.plant_learning import LEARNT
from endoscope_core.physics.description import EffectSpec, JointParameters, PlantDescription
from endoscope_core.signals import non_periodic_signal, periodic_signal
from endoscope_lab.papers.tracking_trial import run_tracking_trial, within_reach

JOINT = JointParameters()
NOMINAL = PlantDescription(joints={'bend_x': JOINT})


def off(signs, by=0.1):
    changes = {
        name: getattr(JOINT, name) * (1.0 + by * sign)
        for name, sign in zip(LEARNT, signs, strict=True)
    }
    return PhysicalParameters(replace(JOINT, **changes))


def test_the_whole_chain_follows_with_a_plant_that_is_ten_percent_off():
    signal = within_reach(non_periodic_signal(12.0), NOMINAL)
    none = run_tracking_trial(NOMINAL, signal, FeedforwardLaw(), False, 0).rmse
    left = []
    for exponent in (0.81, 0.9, 0.99):
        law = FeedforwardLaw(
            'physical', (PhysicalParameters(replace(JOINT, capstan_exponent=exponent)),)
        )
        left.append(run_tracking_trial(NOMINAL, signal, law, False, 0).rmse / none)
    assert left[1] < 0.02
    assert max(left) < 0.15


@pytest.mark.parametrize(
    'signs',
    [
        (-1, 1, 1, -1, 1, -1),
        *(
            pytest.param(signs, marks=pytest.mark.nightly)
            for signs in ((1,) * 6, (1, -1, 1, -1, -1, 1), (-1,) * 6)
        ),
    ],
)
def test_a_plant_that_is_ten_percent_off_is_learnt_within_a_cycle(signs):
    signal = non_periodic_signal(14.0).scaled(0.8)
    none = run_tracking_trial(NOMINAL, signal, FeedforwardLaw(), False, 0)
    law = FeedforwardLaw('adaptive_physical', (off(signs),))
    learnt = run_tracking_trial(NOMINAL, signal, law, True, 0)
    late = none.time >= 7.0

    def rms(trial):
        return np.sqrt(np.mean((trial.bending[:, 0] - trial.desired)[late] ** 2))

    assert rms(learnt) < 0.06 * rms(none)


@pytest.mark.nightly
def test_a_tube_that_is_bent_almost_twice_as_much_as_thought_is_learnt_within_a_cycle():
    straight = PhysicalParameters(replace(JOINT, capstan_exponent=0.6))
    bent = replace(JOINT, capstan_exponent=1.1)
    signal = periodic_signal(4.0 + 4.2 * np.pi).scaled(0.6)
    plant = PlantDescription(joints={'bend_x': bent})
    none = run_tracking_trial(plant, signal, FeedforwardLaw(), False, 0)
    fixed = run_tracking_trial(plant, signal, FeedforwardLaw('physical', (straight,)), False, 0)
    law = FeedforwardLaw('adaptive_physical', (straight,))
    learnt = run_tracking_trial(plant, signal, law, True, 0)
    late = none.time >= 4.0 + 2.0 * np.pi

    def rms(trial):
        return np.sqrt(np.mean((trial.bending[:, 0] - trial.desired)[late] ** 2))

    assert rms(fixed) > 0.2 * rms(none)
    assert rms(learnt) < 0.04 * rms(none)


@pytest.mark.nightly
def test_physics_that_the_model_lacks_does_not_lead_the_learning_astray():
    heavy = PlantDescription(
        joints={'bend_x': JOINT}, effects=(EffectSpec('gravity', 'bend_x', {'moment_nm': 0.001}),)
    )
    signal = periodic_signal(3.2 * np.pi).scaled(0.8)
    known = (PhysicalParameters(JOINT),)
    fixed = run_tracking_trial(heavy, signal, FeedforwardLaw('physical', known), False, 0)
    learnt = run_tracking_trial(heavy, signal, FeedforwardLaw('adaptive_physical', known), True, 0)
    assert learnt.rmse < fixed.rmse
