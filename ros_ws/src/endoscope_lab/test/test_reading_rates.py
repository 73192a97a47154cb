import numpy as np
import pytest

from endoscope_core.classifier.weights_file import load_classifier
from endoscope_core.dataset import CLASSES_DEG
from endoscope_core.signals import CALIBRATION_MOTIONS, calibration_motion
from endoscope_lab.calibration_rate import judged_at_rate, tubes_of_all_classes


@pytest.fixture(scope='module', params=CALIBRATION_MOTIONS)
def classifier(request):
    return load_classifier(motion=request.param)


@pytest.fixture(scope='module')
def tubes(classifier):
    return tubes_of_all_classes(7, 1, calibration_motion(classifier.motion))


@pytest.mark.parametrize('rate', [100, 200, 450, 990, 1000])
def test_every_class_is_found_whatever_the_line_carries(classifier, tubes, rate):
    trials = [judged_at_rate(classifier, tube, rate, 7 + k) for k, tube in enumerate(tubes)]
    assert [t.reason for t in trials] == [''] * len(CLASSES_DEG)
    assert [t.result.class_deg for t in trials] == list(CLASSES_DEG)
    assert max(abs(np.rad2deg(t.result.size - t.size)) for t in trials) < 3.0


# A cell that clips above three quarters of its peak passes at any rate.
@pytest.mark.parametrize('kind', ['slack', 'stuck', 'unplugged', 'exchanged in a joint'])
def test_what_is_no_known_tube_is_refused_at_100_hz_too(classifier, tubes, kind):
    for seed, tube in enumerate(tubes):
        assert judged_at_rate(classifier, tube, 100.0, seed, kind=kind).result is None


def test_readings_that_come_too_seldom_are_refused_and_say_why(classifier, tubes):
    assert '100 Hz or more' in judged_at_rate(classifier, tubes[0], 50, 7).reason
