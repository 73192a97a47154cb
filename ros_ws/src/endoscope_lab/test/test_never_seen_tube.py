import numpy as np
import pytest

from endoscope_core.classifier.weights_file import load_classifier
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


def test_from_tensions_alone_the_physical_inverse_leaves_a_twentieth_of_the_error():
    tube = never_seen_tube(9, 0)
    findings = calibrate(tube, load_classifier())
    assert findings.size == pytest.approx(tube.size, abs=np.deg2rad(8.0))
    signal = within_reach(periodic_signal(3.5 * np.pi), tube.plant)
    none = run_tracking_trial(tube.plant, signal, FeedforwardLaw(), False, tube.noise)
    law = LawChoice(2).law('physical', 'plant', findings)
    helped = run_tracking_trial(tube.plant, signal, law, False, tube.noise)
    assert helped.rmse < 0.05 * none.rmse
    assert backlash_left(helped, signal) < np.deg2rad(1.0)


def test_the_bouc_wen_set_of_the_class_leaves_a_quarter_of_the_error():
    tube = never_seen_tube(9, 0)
    findings = calibrate(tube, load_classifier())
    signal = within_reach(periodic_signal(3.5 * np.pi), tube.plant)
    none = run_tracking_trial(tube.plant, signal, FeedforwardLaw(), False, tube.noise)
    law = LawChoice(2).law('bouc_wen', 'class', findings)
    helped = run_tracking_trial(tube.plant, signal, law, False, tube.noise)
    assert helped.rmse < 0.35 * none.rmse
    assert helped.peak(*signal.steady) < np.deg2rad(20.0)
