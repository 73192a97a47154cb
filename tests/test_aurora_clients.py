"""The emulated Aurora serves clients that nobody here wrote, unchanged.

``ndiProbe`` keeps the interpreter to itself, so the emulator runs in a process of its own.
"""

import contextlib
import subprocess
import sys
import time

import ndicapy
import numpy as np
import pytest
from device_readings import until
from sksurgerynditracker.nditracker import NDITracker

from endoscope_emulators.aurora import InstrumentInField

pytestmark = pytest.mark.nightly

BENDING = (0.5, -0.2)


@pytest.fixture(scope='module')
def port(tmp_path_factory):
    link = tmp_path_factory.mktemp('aurora') / 'ttyAurora'
    command = [sys.executable, '-m', 'endoscope_emulators.aurora']
    with subprocess.Popen(
        [*command, '--link', str(link), '--bending', *map(str, BENDING)], stdout=subprocess.PIPE
    ) as process:
        assert process.stdout.readline().decode().strip() == str(link)
        yield str(link)
        process.terminate()
        assert process.wait() == 0
    assert not link.exists()


def found(port):
    """Probe until the tracker is found: on a busy machine it may answer too late for a probe."""
    until(lambda: ndicapy.ndiProbe(port) == ndicapy.NDI_OKAY)
    return ndicapy.ndiOpen(port)


def expected():
    view = InstrumentInField(lambda _: BENDING)(0.0)
    x, y, z, w = view.orientation
    return np.array((w, x, y, z)), 1e3 * np.array(view.position)


def test_ndicapi_finds_and_tracks_it_also_where_it_was_left_tracking(port):
    device = found(port)
    try:
        for command in ('INIT:', 'COMM:50000', 'PINIT:0A', 'PENA:0AD', 'TSTART:'):
            assert ndicapy.ndiCommand(device, command) == 'OKAY'
        quaternion, position = expected()
        for mode, transform, frame in (
            ('BX:0801', ndicapy.ndiGetBXTransform, ndicapy.ndiGetBXFrame),
            ('TX:0801', ndicapy.ndiGetTXTransform, ndicapy.ndiGetTXFrame),
        ):
            ndicapy.ndiCommand(device, mode)
            pose = transform(device, b'\x0a')
            np.testing.assert_allclose(pose[:4], quaternion, atol=1e-4)
            np.testing.assert_allclose(pose[4:7], position, atol=0.01)
            first = frame(device, b'\x0a')
            time.sleep(0.1)
            ndicapy.ndiCommand(device, mode)
            assert frame(device, b'\x0a') > first
    finally:
        ndicapy.ndiClose(device)
    # It was left tracking, and at another rate.
    device = found(port)
    for command in ('INIT:', 'PINIT:0A', 'PENA:0AD', 'TSTART:', 'TSTOP:'):
        assert ndicapy.ndiCommand(device, command) == 'OKAY'
    ndicapy.ndiClose(device)


def test_scikit_surgery_tracks_it(port):
    settings = {'tracker type': 'aurora', 'serial port': port, 'use quaternions': True}
    opened = []

    def opens():
        with contextlib.suppress(OSError):
            opened.append(NDITracker(settings))
        return opened

    until(opens)
    (tracker,) = opened
    try:
        tracker.start_tracking()
        handles, _, frames, poses, quality = tracker.get_frame()
        time.sleep(0.1)
        later = tracker.get_frame()[2]
    finally:
        tracker.close()
    assert handles == [0x0A]
    assert later[0] > frames[0]
    quaternion, position = expected()
    np.testing.assert_allclose(poses[0][0][:4], quaternion, atol=1e-6)
    np.testing.assert_allclose(poses[0][0][4:], position, atol=1e-3)
    assert quality[0] == pytest.approx(0.3)
