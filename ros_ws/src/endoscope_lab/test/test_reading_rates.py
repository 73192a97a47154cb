"""The shipped classifiers judge tubes whatever a line of load cells carries."""

import numpy as np
import pytest

from endoscope_core.classifier.weights_file import load_classifier
from endoscope_core.signals import CALIBRATION_MOTIONS, calibration_motion
from endoscope_lab.dataset import CLASSES_DEG
from endoscope_lab.papers.calibrations import judged_at_rate, tubes_of_classes


@pytest.mark.parametrize('motion', CALIBRATION_MOTIONS)
def test_every_class_is_found_and_what_is_no_known_tube_refused(motion):
    classifier = load_classifier(motion=motion)
    tubes = tubes_of_classes(7, 1, calibration_motion(motion))
    for rate in (100, 450, 1000):
        found = [judged_at_rate(classifier, tubes, k, rate, 7 + k) for k in range(7)]
        assert [each.class_deg for each in found] == list(CLASSES_DEG)
        assert np.rad2deg(np.abs([e.size for e in found] - tubes.size)).max() < 3.0
    # A cell that clips above three quarters of its peak passes at any rate.
    for kind in ('slack', 'stuck', 'unplugged', 'exchanged in a joint'):
        assert judged_at_rate(classifier, tubes, 2, 100, 2, kind=kind) is None
    assert judged_at_rate(classifier, tubes, 0, 50, 7) is None, 'too seldom'
