"""The shipped classifiers on tubes that they have not seen."""

import numpy as np
import pytest

from endoscope_core.classifier.classification import UnseenTensionError
from endoscope_core.classifier.cnn_classifier import load_classifier
from endoscope_core.signals import CALIBRATION_MOTIONS, calibration_motion
from endoscope_lab.dataset import CLASSES_DEG, record_calibration
from endoscope_lab.papers.calibrations import judged_at_rate, tubes_of_classes
from endoscope_lab.papers.tracking_trial import never_seen_tube
from endoscope_lab.training.held_out_calibration import STRANGE


@pytest.fixture(scope='module', params=CALIBRATION_MOTIONS)
def shipped(request):
    return load_classifier(motion=request.param)


@pytest.mark.parametrize(
    'size_deg',
    [42.0, 101.0, *(pytest.param(s, marks=pytest.mark.nightly) for s in (57.0, 73.5, 88.0))],
)
def test_it_regresses_the_size_of_a_tube_it_has_not_seen(shipped, size_deg):
    tube = never_seen_tube(0, int(10 * size_deg), size_deg)
    tension = record_calibration(tube.plant, 5, calibration_motion(shipped.motion)).tension
    result = shipped.classify(tension)
    assert np.rad2deg(result.size) == pytest.approx(size_deg, abs=3.0)
    low, high = result.interval
    assert low < result.size < high
    assert np.rad2deg(high - low) < 10.0
    assert abs(result.class_deg - size_deg) < 8.0
    assert result.probability == max(result.probabilities.values())
    assert sum(result.probabilities.values()) == pytest.approx(1.0)
    assert result.expected_size == result.size


@pytest.mark.parametrize('kind', STRANGE)
def test_unusual_tensions_are_refused_with_a_reason(shipped, kind):
    generator = np.random.default_rng(3)
    motion = calibration_motion(shipped.motion)
    tension = record_calibration(never_seen_tube(0, 70, 70.0).plant, 5, motion).tension
    tension = STRANGE[kind](tension.astype(np.float32), generator)
    with pytest.raises(UnseenTensionError, match='none of the classes: '):
        shipped.classify(tension)


def test_at_any_rate_every_class_is_found_and_what_is_no_known_tube_refused(shipped):
    tubes = tubes_of_classes(7, 1, calibration_motion(shipped.motion))
    for rate in (100, 450, 1000):
        found = [judged_at_rate(shipped, tubes, k, rate, 7 + k) for k in range(7)]
        assert [each.class_deg for each in found] == list(CLASSES_DEG)
        assert np.rad2deg(np.abs([e.size for e in found] - tubes.size)).max() < 3.0
    # A cell that clips above three quarters of its peak passes at any rate.
    for kind in ('slack', 'stuck', 'unplugged', 'exchanged in a joint'):
        assert judged_at_rate(shipped, tubes, 2, 100, 2, kind=kind) is None
    assert judged_at_rate(shipped, tubes, 0, 50, 7) is None, 'too seldom'
