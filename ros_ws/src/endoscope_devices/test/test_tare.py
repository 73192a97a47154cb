import numpy as np
import pytest

from endoscope_core.errors import FileError
from endoscope_devices.load_cells import TareError, apply_saved_tare, save_tare, tare_path
from endoscope_devices.load_cells.calibration_file import (
    FaultLimits,
    LoadCellCalibration,
    TareLimits,
    Transmitter,
    WireCell,
)
from endoscope_devices.load_cells.tare import TareWindow, with_zero, zero_after_tare

MS = 1_000_000
WIRES = ('pos', 'neg')
CALIBRATION = LoadCellCalibration(
    Transmitter(),
    {'pos': WireCell(0, 'int32', 0.001, 1, 100.0), 'neg': WireCell(2, 'int32', 0.002, -1, 0.0)},
    FaultLimits(-9e4, 9e4, -8e4, 8e4),
    TareLimits(),
    'abc',
)


def window(values):
    filled = TareWindow(WIRES, TareLimits())
    for k, tension in enumerate(values):
        filled.add(5 * MS * k, tuple(tension))
    return filled, 5 * MS * (len(values) - 1)


def resting(count=400, noise=0.02, at=(0.5, -0.3)):
    return np.array(at) + np.random.default_rng(2).normal(0.0, noise, (count, 2))


def test_the_mean_of_the_last_second_is_taken():
    filled, now = window(np.vstack([resting(at=(1.9, 1.9)), resting()]))
    assert filled.mean(now) == pytest.approx((0.5, -0.3), abs=0.01)


def test_after_a_tare_the_same_counts_are_no_tension():
    tared = with_zero(CALIBRATION, zero_after_tare(CALIBRATION, (0.5, -0.3)))
    for name, tension in (('pos', 0.5), ('neg', -0.3)):
        cell = CALIBRATION.wires[name]
        count = cell.zero + cell.sign * tension / cell.newton_per_count
        assert cell.tension(count) == pytest.approx(tension)
        assert tared.wires[name].tension(count) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        (resting(10), '10 good readings'),
        (resting(noise=0.02) + 0.3 * (-1.0) ** np.arange(400)[:, None], 'is noisy by'),
        (resting(at=(0.5, 5.0)), 'neg is 5 N, at most 2 N'),
        (resting(noise=0.001) + np.linspace(0.0, 0.5, 400)[:, None], 'changes by'),
    ],
)
def test_loaded_noisy_or_moving_wires_are_refused(values, words):
    filled, now = window(values)
    with pytest.raises(TareError, match=words):
        filled.mean(now)


def test_old_readings_are_none():
    filled, now = window(resting())
    with pytest.raises(TareError, match='0 good readings'):
        filled.mean(now + 1_100 * MS)


@pytest.mark.parametrize('velocity', [(0.0, 0.5), (-0.1, 0.0), (float('nan'), 0.0)])
def test_turning_shafts_forbid_it_for_a_second(velocity):
    filled, now = window(resting())
    filled.note_shafts(now - 10 * MS, velocity)
    filled.note_shafts(now, (0.0, 0.0))
    with pytest.raises(TareError, match='the wires move'):
        filled.mean(now)
    filled.note_shafts(now - 10 * MS, (0.001, -0.001))


def test_a_tare_is_kept_and_found_again(tmp_path):
    path = tare_path(tmp_path / 'cells.yaml')
    assert apply_saved_tare(path, CALIBRATION) == CALIBRATION
    tared = with_zero(CALIBRATION, (600.0, 150.0))
    save_tare(path, tared)
    assert path.name == 'cells.tare.yaml'
    assert apply_saved_tare(path, CALIBRATION) == tared


def test_a_tare_of_another_calibration_is_refused(tmp_path):
    path = tmp_path / 'cells.tare.yaml'
    save_tare(path, CALIBRATION)
    path.write_text(path.read_text().replace('abc', 'abd'))
    with pytest.raises(FileError, match='taken with another calibration: remove it'):
        apply_saved_tare(path, CALIBRATION)
