import numpy as np
import pytest

from endoscope_core.classifier.cnn_classifier import load_classifier
from endoscope_core.control import FeedforwardLaw
from endoscope_core.identification.law_choice import LawChoice
from endoscope_core.signals import periodic_signal
from endoscope_lab.papers.tracking_trial import (
    backlash_left,
    calibrate,
    never_seen_tube,
    run_tracking_trial,
    within_reach,
)


@pytest.mark.nightly
def test_from_tensions_alone_the_inverse_leaves_a_twentieth_and_bouc_wen_a_third():
    tube = never_seen_tube(9, 0)
    findings = calibrate(tube, load_classifier())
    assert findings.size == pytest.approx(tube.size, abs=np.deg2rad(8.0))
    signal = within_reach(periodic_signal(3.5 * np.pi), tube.plant)
    choice = LawChoice(2)
    laws = FeedforwardLaw(), choice.law('bouc_wen', 'class', findings)
    laws += (choice.law('physical', 'plant', findings),)
    none, by_class, inverse = (
        run_tracking_trial(tube.plant, signal, law, False, tube.noise) for law in laws
    )
    assert inverse.rmse < 0.05 * none.rmse
    assert backlash_left(inverse, signal) < np.deg2rad(1.0)
    assert by_class.rmse < 0.35 * none.rmse
    assert by_class.peak(*signal.steady) < np.deg2rad(20.0)
