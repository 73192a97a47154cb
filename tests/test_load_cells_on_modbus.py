"""Load cells over a real serial line and a real network connection, with what goes wrong there."""

import itertools
import threading
import time
from pathlib import Path

import minimalmodbus
import pytest
from device_readings import collect, figure, until
from load_cell_rig import BROKEN, ZERO, Cells, transmitter, write_calibration

from endoscope_devices.load_cells import load_calibration, modbus_rtu, modbus_tcp
from endoscope_devices.load_cells.calibration_file import SerialSettings
from endoscope_devices.load_cells.modbus_framing import ReplyError, RtuFraming
from endoscope_devices.load_cells.modbus_line import RegisterReader, SerialLine
from endoscope_emulators.cables.serial_cable import SerialCable
from endoscope_emulators.cables.tcp_cable import TcpCable
from endoscope_nodes.names import WIRES


@pytest.fixture
def calibration(tmp_path):
    return load_calibration(write_calibration(tmp_path), WIRES)


@pytest.fixture
def cells():
    return Cells()


@pytest.fixture
def cable(tmp_path, cells):
    with (
        SerialCable(tmp_path / 'ttyCells') as cable,
        transmitter(cells, serial_port=cable.device),
    ):
        yield cable


@pytest.fixture
def network(cells):
    with transmitter(cells) as server, TcpCable(server.tcp_port) as cable:
        cable.server = server
        yield cable


@pytest.fixture
def on_serial(cable, calibration):
    device = modbus_rtu(str(cable.host), calibration)
    device.open()
    yield device
    device.close()


@pytest.fixture
def on_tcp(network, calibration):
    device = modbus_tcp(f'127.0.0.1:{network.port}', calibration)
    device.open()
    yield device
    device.close()


@pytest.mark.parametrize('line', ['on_serial', 'on_tcp'])
def test_tensions_come_as_the_cells_show_them(line, cells, request):
    device = request.getfixturevalue(line)
    cells.tension = dict(zip(WIRES, (5.0, 0.0, 42.5, -1.5), strict=True))
    readings = collect(device, 20)[-10:]
    for reading in readings:
        assert reading.tension == pytest.approx((5.0, 0.0, 42.5, -1.5), abs=0.0021)
    stamps = [reading.time_ns for reading in readings]
    assert stamps == sorted(set(stamps))
    assert device.health()[0] == ''


@pytest.mark.nightly
def test_minimalmodbus_reads_the_same_line_to_the_same_tensions(cable, cells, calibration):
    cells.freeze = set(WIRES)
    cells.count = dict(zip(WIRES, (5120, -380, 42_620, 60_000), strict=True))
    other = minimalmodbus.Instrument(str(cable.host), 1)
    other.serial.baudrate = 115200
    counts = [other.read_long(2 * k, functioncode=4, signed=True) for k in range(4)]
    other.serial.close()
    assert counts == [5120, -380, 42_620, 60_000]
    device = modbus_rtu(str(cable.host), calibration)
    device.open()
    try:
        reading = collect(device, 1)[0]
    finally:
        device.close()
    expected = [
        cell.tension(count) for cell, count in zip(calibration.wires.values(), counts, strict=True)
    ]
    assert reading.tension == pytest.approx(expected)


def test_a_broken_cell_takes_all_readings_with_it_until_it_is_whole(on_serial, cells):
    collect(on_serial, 5)
    cells.count = {'wire_y_pos': BROKEN}
    until(lambda: on_serial.health()[0])
    on_serial.take()
    before = figure(on_serial, 'readings')
    until(lambda: figure(on_serial, 'not believed') > 20)
    assert figure(on_serial, 'readings') == before
    assert on_serial.health()[0] == f'wire_y_pos: broken wire of the cell ({BROKEN:.6g} counts)'
    cells.count = {}
    assert collect(on_serial, 5)[0].tension[2] == pytest.approx(5.0, abs=0.0021)
    assert on_serial.health()[0] == ''


@pytest.mark.nightly
def test_a_late_reply_is_never_the_answer_to_a_later_question(cable, cells):
    """Where 50 ms are allowed; what a reply says tells when it was asked for."""
    line = SerialLine(str(cable.host), SerialSettings())
    reader = RegisterReader(line, RtuFraming(1, 4), 0.05)
    coming = itertools.cycle((0.07,) + 6 * (0.0,))
    cable.to_host = lambda data: [(next(coming), data)]
    cells.freeze = set(WIRES)
    answered, silent = 0, 0
    line.open()
    try:
        for question in range(60):
            cells.count = {'wire_x_pos': question}
            try:
                registers = reader.read(0, 8).registers
            except ReplyError:
                silent += 1
                continue
            answered += 1
            assert registers[1] == question
    finally:
        line.close()
    assert answered > 30
    assert silent > 5


@pytest.mark.nightly
def test_a_line_that_is_never_silent_is_given_up(tmp_path):
    over = threading.Event()

    def chat(device):
        with Path(device).open('wb', buffering=0) as port:
            while not over.wait(0.005):
                port.write(b'?')

    with SerialCable(tmp_path / 'ttyCells') as cable:
        line = SerialLine(str(cable.host), SerialSettings())
        reader = RegisterReader(line, RtuFraming(1, 4), 0.05)
        line.open()
        thread = threading.Thread(target=chat, args=[cable.device])
        thread.start()
        try:
            while not line.read(1, 0):
                time.sleep(0.005)
            for _ in range(2):
                with pytest.raises(ReplyError):
                    reader.read(0, 8)
        finally:
            over.set()
            thread.join()
            line.close()


def test_flipped_bits_and_doubled_replies_are_counted_and_no_number(cable, on_serial):
    collect(on_serial, 5)
    number = [0]

    def flip(data):
        number[0] += 1
        spoilt = bytearray(data)
        spoilt[number[0] * 7 % len(spoilt)] ^= (number[0] % 3 == 0) << number[0] % 8
        return [(0.0, bytes(spoilt))]

    def double(data):
        number[0] += 1
        return [(0.0, data + data if number[0] % 5 == 0 else data)]

    for spoil, counted, times in ((flip, 'wrong CRC', 15), (double, 'unexpected bytes', 100)):
        cable.to_host = spoil
        on_serial.take()
        until(lambda what=counted, n=times: figure(on_serial, what) >= n)
        for reading in collect(on_serial, 10):
            assert reading.tension == pytest.approx((5.0,) * 4, abs=0.0021)


def test_late_tcp_replies_are_told_by_their_number_and_a_busy_transmitter_is_said(
    network, on_tcp, cells
):
    collect(on_tcp, 5)
    number = [0]

    def late(data):
        number[0] += 1
        return [(0.07 if number[0] % 4 == 0 else 0.0, data)]

    network.to_host = late
    until(lambda: figure(on_tcp, 'no reply') >= 5)
    network.to_host = lambda data: [(0.0, data)]
    on_tcp.take()
    for reading in collect(on_tcp, 5):
        assert reading.tension == pytest.approx((5.0,) * 4, abs=0.0021)
    cells.busy = True
    until(lambda: 'exception 6' in on_tcp.health()[0])
    cells.busy = False
    until(lambda: on_tcp.health()[0] == '')


def test_an_unplugged_adapter_is_said_and_found_again(cable, on_serial):
    collect(on_serial, 5)
    cable.unplug()
    until(lambda: 'ttyCells' in on_serial.health()[0])
    cable.plug_in()
    on_serial.take()
    collect(on_serial, 5)
    assert on_serial.health()[0] == ''
    assert figure(on_serial, 'connections') == 2


def test_after_a_tare_the_tension_at_rest_is_nothing(on_serial, cells):
    cells.tension = dict.fromkeys(WIRES, 0.75)
    collect(on_serial, 220)
    tared = on_serial.tared()
    on_serial.use(tared)
    assert tared.wires['wire_x_pos'].zero == pytest.approx(ZERO + 750, abs=1)
    on_serial.take()
    assert collect(on_serial, 5)[-1].tension == pytest.approx((0.0,) * 4, abs=0.004)
