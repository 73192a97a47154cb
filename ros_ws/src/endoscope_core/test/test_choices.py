"""What can be chosen by name is what there is."""

from endoscope_core import choices
from endoscope_core.hysteresis import MODELS
from endoscope_core.signals import MOTIONS, calibration_motion


def test_every_name_leads_to_what_it_names():
    assert tuple(MODELS) == choices.HYSTERESIS_MODELS
    assert tuple(MOTIONS) == choices.PLAYED_MOTIONS
    for name in choices.CALIBRATION_MOTIONS:
        assert calibration_motion(name).name == name
