"""How long a classifier takes to judge a calibration."""

import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from endoscope_core.classifier.classification import Classifier

_INFERENCES = 200


def inference_time(classifier: 'Classifier') -> float:
    """Median of one judgement in s, of what is judged to the end."""
    import numpy as np

    from endoscope_core.dataset import record_calibration
    from endoscope_core.physics import PlantDescription
    from endoscope_core.signals import calibration_motion

    motion = calibration_motion(classifier.motion)
    tension = record_calibration(PlantDescription(), 0, motion).tension
    spent = []
    for _ in range(_INFERENCES):
        start = time.perf_counter()
        classifier.classify(tension)
        spent.append(time.perf_counter() - start)
    return float(np.median(spent))
