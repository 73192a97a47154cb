"""Compensation of a tube that nothing was fitted on, from its tensions to its tracking error."""

import numpy as np
import pytest

from endoscope_core.classifier.inference import TensionClassifier
from endoscope_core.control import (
    AdaptiveBacklashController,
    BoucWenFeedforward,
    FeedforwardLaw,
    TrackerMeasurement,
)
from endoscope_core.dataset import random_rig, record_calibration
from endoscope_core.dataset.rig_variation import in_tube
from endoscope_core.identification import load_class_parameters, parameters_for_class
from endoscope_core.metrics import tracking_rmse
from endoscope_core.plant import PlantSimulator, SensorModel
from endoscope_core.signals import periodic_signal

TICK = 1e-3


def track(plant, signal, law, feedback):
    """RMSE in rad of both joints in the signal's steady part."""
    rig, sensors = PlantSimulator(plant), SensorModel(plant.sensors, 11)
    gears = np.array([joint.gear for joint in plant.joints.values()])
    feedforward, controller = BoucWenFeedforward(2), AdaptiveBacklashController(2)
    feedforward.select(law)
    if feedback:
        controller.activate()
    time = np.arange(0.0, signal.steady[1], TICK)
    angles, velocities = signal(time)
    bending = np.empty((time.size, 2))
    for k, now in enumerate(time):
        sample = rig.sample
        bending[k] = sample.bending
        desired, velocity = [angles[k]] * 2, [velocities[k]] * 2
        measured = TrackerMeasurement(now, sensors.bending(sample.bending)) if k % 25 == 0 else None
        correction = controller.step(now, desired, velocity, measured)
        rig.advance(gears * (feedforward.step(desired, velocity, TICK) + correction))
    steady = time >= signal.steady[0]
    wanted = np.stack([angles[steady]] * 2, axis=1)
    return tracking_rmse(wanted, bending[steady])


@pytest.mark.parametrize(('exponent', 'seed'), [(0.62, 71), (1.45, 72)])
def test_the_whole_chain_reduces_the_error_as_required(exponent, seed):
    plant = in_tube(random_rig(np.random.default_rng([seed, 424_242])), exponent)
    tension = record_calibration(plant, seed).tension
    class_deg = TensionClassifier.load_default().classify(tension).class_deg
    parameters = parameters_for_class(load_class_parameters(), class_deg)
    law = FeedforwardLaw('bouc_wen', (parameters, parameters))
    signal = periodic_signal()
    alone = track(plant, signal, FeedforwardLaw(), feedback=False)
    assert track(plant, signal, law, feedback=False) <= 0.30 * alone
    assert track(plant, signal, law, feedback=True) <= 0.15 * alone
