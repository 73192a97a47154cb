"""A rig is identified from recordings of its tubes."""

import numpy as np
import pytest
from outside_data import REAL, needs

from endoscope_core.errors import InputError
from endoscope_core.physics.family import ReadingErrors, TubeFamily, shipped_family
from endoscope_lab.identification.family_fit import (
    PRIORS,
    TubeRecording,
    fit_family,
    misfit,
    read,
    tube_recordings,
)

BENDS = np.deg2rad([0.0, 60.0, 120.0, 180.0, 240.0])
TICK = 5e-3
MADE_UP = TubeFamily(
    {
        'capstan_exponent': (0.9, 0.4),
        'joint_stiffness': (0.005,),
        'joint_rest_angle': (-0.05, 0.01, 0.02),
    },
    readings=ReadingErrors((0.3, -0.1), 0.05, 0.01),
)


def made_up_recording(family: TubeFamily, bend: float) -> TubeRecording:
    desired = np.deg2rad(60.0) * np.sin(1.1 * TICK * np.arange(1200))
    angle, tension = read(family, bend, desired, TICK)
    return TubeRecording(bend, TICK, desired, angle, tension, (0, 1143))


def test_known_numbers_are_found_again():
    recordings = [made_up_recording(MADE_UP, bend) for bend in BENDS[::2]]
    free = ('capstan_exponent', 'joint_stiffness', 'joint_rest_angle', 'load_cell_offset')
    wide = {key: (PRIORS[key][0], tuple(20.0 * w for w in PRIORS[key][1])) for key in free}
    delays = {'load_cell_delay': ((0.05,), (1e-6,)), 'tracker_delay': ((0.01,), (1e-6,))}
    found = fit_family(recordings, {**wide, **delays}, starts=1)
    for key in free[:3]:
        line = (*MADE_UP.lines[key], 0.0, 0.0)[: len(found.lines[key])]
        np.testing.assert_allclose(found.lines[key], line, rtol=0.03, atol=3e-3)
    np.testing.assert_allclose(found.readings.load_cell_offset, (0.3, -0.1), atol=0.01)


def test_uninformative_recordings_are_refused():
    with pytest.raises(InputError, match='no recordings'):
        fit_family([])
    recording = made_up_recording(MADE_UP, 0.0)
    with pytest.raises(InputError, match='bent by 0 deg: 50 samples'):
        fit_family([recording.until(50)])
    recording.angle[3] = np.nan
    with pytest.raises(InputError, match='not finite'):
        fit_family([recording])


@needs(REAL)
def test_the_shipped_family_reads_as_the_real_rig_does_in_the_cycle_not_fitted():
    recordings = tube_recordings(REAL)
    assert [recording.bend for recording in recordings] == pytest.approx(list(BENDS))
    for recording in recordings:
        left = misfit(shipped_family(), recording, 2)
        assert np.rad2deg(left.angle) < 1.5, recording.bend
        assert left.tension.max() < 0.4, recording.bend
