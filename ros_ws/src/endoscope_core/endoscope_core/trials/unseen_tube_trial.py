"""The first paper's procedure on a tube that nothing was fitted on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from endoscope_core.classifier.classification import Classifier, UnseenTensionError
from endoscope_core.control import FeedforwardLaw
from endoscope_core.dataset import record_calibration
from endoscope_core.dataset.rig_variation import backlash_sizes
from endoscope_core.identification import LawParameters, parameters_for_class
from endoscope_core.signals import Signal
from endoscope_core.trials.classifier_trial import random_tube
from endoscope_core.trials.tracking_trial import run_tracking_trial

# Data sets draw from the seed alone; this keeps tubes judged on apart from tubes learnt from.
_UNSEEN = 424_242


@dataclass(frozen=True)
class UnseenTubeTrial:
    """Result for one tube.

    Parameters
    ----------
    exponent : float
        Capstan exponent, mean of the joints.
    size : float
        True backlash size, mean of the joints, in rad.
    class_deg : int or None
        Class that the classifier named; None where it refused, and nothing was compensated.
    uncompensated : dict of str to float
        RMSE in rad by signal.
    feedforward, feedback : dict of str to float
        RMSE over the uncompensated one, without and with the tracker.
    """

    exponent: float
    size: float
    class_deg: int | None
    uncompensated: dict[str, float]
    feedforward: dict[str, float]
    feedback: dict[str, float]

    @property
    def nearest_class(self) -> bool:
        """Whether no other class is nearer to the true size."""
        if self.class_deg is None:
            return False
        return abs(np.rad2deg(self.size) - self.class_deg) <= 5.0


def run_unseen_tube_trial(
    seed: int,
    number: int,
    signals: Sequence[Signal],
    classifier: Classifier,
    sets: Mapping[int, LawParameters],
) -> UnseenTubeTrial:
    """Calibrate, classify, choose parameters and track, on a random rig in a random tube.

    Parameters
    ----------
    seed, number : int
        Together they choose rig, tube and noise.
    signals : sequence of Signal
    classifier : Classifier
        Of the sinusoid.
    sets : mapping of int to BoucWenParameters
        By class.
    """
    generator = np.random.default_rng([_UNSEEN, seed, number])
    plant = random_tube(generator)
    exponent = float(np.mean([joint.capstan_exponent for joint in plant.joints.values()]))
    noise = int(generator.integers(2**31))
    law = FeedforwardLaw()
    class_deg = None
    try:
        class_deg = classifier.classify(record_calibration(plant, noise).tension).class_deg
    except UnseenTensionError:
        # As the nodes have it: a tube of no known class is not compensated.
        pass
    else:
        parameters = parameters_for_class(sets, class_deg)
        law = FeedforwardLaw('bouc_wen', (parameters,) * len(plant.joints))
    alone, helped, corrected = {}, {}, {}
    for signal in signals:
        name = signal.name
        alone[name] = run_tracking_trial(plant, signal, FeedforwardLaw(), False, noise).rmse
        helped[name] = run_tracking_trial(plant, signal, law, False, noise).rmse / alone[name]
        corrected[name] = run_tracking_trial(plant, signal, law, True, noise).rmse / alone[name]
    size = float(np.mean(backlash_sizes(plant)))
    return UnseenTubeTrial(exponent, size, class_deg, alone, helped, corrected)
