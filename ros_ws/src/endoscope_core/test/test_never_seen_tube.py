import numpy as np
import pytest

from endoscope_core.classifier.shipped import load_classifier
from endoscope_core.control import FeedforwardLaw
from endoscope_core.identification.law_choice import (
    CalibrationFindings,
    LawChoice,
    LawChoiceError,
)
from endoscope_core.identification.updated_table import UpdatedTableError
from endoscope_core.signals import periodic_signal
from endoscope_core.trials.never_seen_tube import (
    backlash_left,
    calibrate,
    never_seen_tube,
    within_reach,
)
from endoscope_core.trials.tracking_trial import run_tracking_trial


def test_from_tensions_alone_the_physical_inverse_takes_away_nine_tenths_of_the_error():
    tube = never_seen_tube(9, 0)
    findings = calibrate(tube, load_classifier())
    assert findings.size == pytest.approx(tube.size, abs=np.deg2rad(8.0))
    signal = periodic_signal(3.5 * np.pi)
    none = run_tracking_trial(tube.plant, signal, FeedforwardLaw(), False, tube.noise)
    law = LawChoice(2).law('physical', 'plant', findings)
    helped = run_tracking_trial(tube.plant, signal, law, False, tube.noise)
    assert helped.rmse < 0.10 * none.rmse
    assert backlash_left(helped, signal) < np.deg2rad(5.0)


def test_the_bouc_wen_set_of_the_class_leaves_a_quarter_of_the_error():
    tube = never_seen_tube(9, 0)
    findings = calibrate(tube, load_classifier())
    signal = within_reach(periodic_signal(3.5 * np.pi), tube.plant)
    none = run_tracking_trial(tube.plant, signal, FeedforwardLaw(), False, tube.noise)
    law = LawChoice(2).law('bouc_wen', 'class', findings)
    helped = run_tracking_trial(tube.plant, signal, law, False, tube.noise)
    assert helped.rmse < 0.35 * none.rmse
    assert helped.peak(*signal.steady) < np.deg2rad(20.0)


def test_a_law_is_never_guessed(tmp_path):
    choice = LawChoice(2)
    nothing = CalibrationFindings()
    assert choice.law('none', 'class', nothing) == FeedforwardLaw()
    for by in ('class', 'size', 'plant'):
        with pytest.raises(LawChoiceError, match='did not'):
            choice.law('physical', by, nothing)
    with pytest.raises(LawChoiceError, match='not selected by plant'):
        choice.law('play', 'plant', nothing)
    with pytest.raises(LawChoiceError, match='unknown selection'):
        choice.law('play', 'dice', nothing)
    with pytest.raises(UpdatedTableError, match='outside the table'):
        choice.law('play', 'size', CalibrationFindings(size=3.0))
    with pytest.raises(UpdatedTableError, match='missing'):
        LawChoice(2, table=str(tmp_path / 'none')).law('play', 'size', CalibrationFindings(size=1))
