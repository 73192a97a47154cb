"""Simulated calibration recordings of known backlash size."""

from endoscope_lab.dataset.calibration_dataset import (
    CLASSES_DEG,
    CalibrationDataset,
    CalibrationRecording,
    is_dataset,
    load_dataset,
    make_dataset,
    record_calibration,
    save_dataset,
)
from endoscope_lab.dataset.rig_variation import (
    TubeConfiguration,
    configuration_of_size,
    random_instrument,
)

__all__ = [
    'CLASSES_DEG',
    'CalibrationDataset',
    'CalibrationRecording',
    'TubeConfiguration',
    'configuration_of_size',
    'is_dataset',
    'load_dataset',
    'make_dataset',
    'random_instrument',
    'record_calibration',
    'save_dataset',
]
