import math

import numpy as np
import pytest

from endoscope_devices.load_cells.calibration_file import FaultLimits, WireCell
from endoscope_devices.load_cells.modbus_load_cells import ChannelCheck

MS = 1_000_000
CELL = WireCell(0, 'int32', 0.001, 1, 0.0)
LIMITS = FaultLimits(-200_000, 200_000, -20_000, 90_000)


class Channel:
    """A channel that is read every 5 ms, of a cell with a count or two of noise."""

    def __init__(self, limits=LIMITS):
        self.check = ChannelCheck('wire_x_pos', CELL, limits)
        self.time_ns = 0
        self.noise = np.random.default_rng(1)

    def read(self, count):
        self.time_ns += 5 * MS
        return self.check.read(self.time_ns, count)

    def live(self, count, readings):
        return [self.read(count + int(self.noise.integers(-2, 3))) for _ in range(readings)]


def test_a_living_cell_gives_tensions():
    channel = Channel()
    assert np.allclose(channel.live(5000, 400), 5.0, atol=0.003)
    assert channel.check.fault == ''


def test_a_pull_as_fast_as_the_motor_can_is_a_tension():
    channel = Channel()
    channel.live(5000, 10)
    steps = [channel.read(5000 + 4000 * k) for k in range(20)]
    assert None not in steps
    assert steps[-1] == pytest.approx(81.0)


@pytest.mark.parametrize(
    ('count', 'fault'),
    [
        (250_000, 'broken wire of the cell'),
        (200_000, 'broken wire of the cell'),
        (-250_000, 'broken wire of the cell'),
        (math.nan, 'broken wire of the cell'),
        (math.inf, 'broken wire of the cell'),
        (95_000, 'saturated'),
        (-20_000, 'saturated'),
    ],
)
def test_what_no_tension_gives_is_a_fault_at_once(count, fault):
    channel = Channel()
    channel.live(5000, 100)
    assert channel.read(count) is None
    assert channel.check.fault.startswith(f'wire_x_pos: {fault}')


def test_a_fault_ends_with_three_good_readings():
    channel = Channel()
    channel.live(5000, 100)
    channel.read(250_000)
    assert channel.live(5000, 2) == [None, None]
    assert channel.check.fault
    assert channel.live(5000, 1)[0] == pytest.approx(5.0, abs=0.003)
    assert channel.check.fault == ''


def test_a_frozen_channel_is_a_fault_after_its_time():
    channel = Channel()
    channel.live(5000, 50)
    believed = sum(channel.read(5003) is not None for _ in range(200))
    assert believed == 100
    assert 'frozen (5003 counts' in channel.check.fault


def test_freezing_can_be_left_out_for_cells_without_noise():
    channel = Channel(FaultLimits(-200_000, 200_000, -20_000, 90_000, frozen_after=0.0))
    assert all(channel.read(5000) == 5.0 for _ in range(1000))


def test_a_spike_is_left_out_and_a_step_is_taken_at_the_third_reading():
    channel = Channel()
    channel.live(5000, 100)
    assert channel.read(60_000) is None
    assert 'spiking (from 5.00 N to 60.00 N)' in channel.check.fault
    channel.live(5000, 10)
    assert channel.check.spikes == 1
    channel.read(60_000)
    assert channel.live(5000, 1) == [None]
    assert None not in channel.live(5000, 220)[2:]
    values = [channel.read(60_000 + k) for k in range(6)]
    assert values[:2] == [None, None]
    assert values[-1] == pytest.approx(60.005)
    assert channel.check.new_levels == 1


def test_what_no_wire_does_in_one_interval_is_left_out():
    channel = Channel()
    channel.live(5000, 100)
    assert channel.read(5000 + 9_000) == pytest.approx(14.0)
    assert channel.read(5000 - 1_000) is None
    assert 'spiking (from 14.00 N to 4.00 N)' in channel.check.fault


def test_a_channel_that_keeps_spiking_is_not_believed_at_all():
    channel = Channel()
    channel.live(5000, 100)
    for _ in range(4):
        channel.read(60_000)
        assert None not in channel.live(5000, 20)[2:]
    channel.read(60_000)
    assert set(channel.live(5000, 100)) == {None}
    assert channel.check.fault == 'wire_x_pos: spiking (5 times within a second)'
    assert None not in channel.live(5000, 200)[110:]
