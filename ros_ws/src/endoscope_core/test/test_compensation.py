"""Compensation of a tube that nothing was fitted on, from its tensions to its tracking error."""

import pytest

from endoscope_core.classifier.shipped import load_classifier
from endoscope_core.identification import load_class_parameters
from endoscope_core.signals import periodic_signal
from endoscope_core.trials.unseen_tube_trial import run_unseen_tube_trial


@pytest.mark.parametrize('number', [100, 101])
def test_the_whole_chain_leaves_a_quarter_of_the_error(number):
    trial = run_unseen_tube_trial(
        3, number, [periodic_signal()], load_classifier(), load_class_parameters()
    )
    assert trial.uncompensated['periodic'] > 0.2
    # Left of it: 0.23 and 0.24 with the tracker.
    assert trial.feedforward['periodic'] <= 0.30
    assert trial.feedback['periodic'] <= 0.26
