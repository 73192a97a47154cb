"""What hours of work make of a rig, and whether it is told."""

from endoscope_core.classifier.weights_file import load_classifier
from endoscope_lab.papers.tracking_trial import calibrate, never_seen_tube
from endoscope_lab.validity import (
    Slow,
    is_told,
)


def test_a_tube_that_is_bent_anew_is_told_and_one_that_stays_is_not():
    tube = never_seen_tube(1, 0)
    first = calibrate(tube, load_classifier())
    assert first.plants
    assert is_told(tube, Slow(factor=1.6), first, 1)
    assert not is_told(tube, Slow(), first, 1)
