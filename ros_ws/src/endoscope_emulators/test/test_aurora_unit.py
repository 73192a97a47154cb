"""Commands and replies of the emulated tracker, without its line."""

import struct

import pytest

from endoscope_devices.em_tracker.aurora_port import crc16
from endoscope_devices.em_tracker.tx_reply import parse_tx
from endoscope_emulators.aurora_unit import AuroraUnit, SensorView, sealed


class Clock:
    seconds = 100.0

    def __call__(self):
        return self.seconds


class Bench:
    def __init__(self, *sources, latency=0.0):
        self.clock = Clock()
        self.unit = AuroraUnit(sources or (lambda _: SensorView(),), self.clock, latency)

    def say(self, command):
        raw = command.encode()
        return self.unit.answer(raw + f'{crc16(raw):04X}'.encode())

    def text(self, command):
        reply = self.say(command)
        assert reply == sealed(reply[:-5].decode())
        return reply[:-5].decode()

    def track(self):
        for command in ('INIT:', 'PINIT:0A', 'PENA:0AD', 'TSTART:'):
            assert self.text(command) == 'OKAY'


def test_checksums_of_the_guide():
    assert crc16(b'INIT:') == 0xE3A5
    assert crc16(b'123456789') == 0xBB3D
    assert sealed('OKAY') == b'OKAYA896\r'
    assert sealed('RESET') == b'RESETBE6F\r'


def test_the_way_to_tracking():
    bench = Bench(lambda _: SensorView(), lambda _: SensorView())
    assert bench.text('INIT:') == 'OKAY'
    assert bench.text('PHSR:02') == '020A0010B001'
    assert bench.text('PINIT:0B') == 'OKAY'
    assert bench.text('PHSR:03') == '010B011'
    assert bench.text('PENA:0BD') == 'OKAY'
    assert bench.text('PHSR:04') == '010B031'
    assert bench.text('PHINF:0B0001') == '02000000NDI         0010000000231'
    assert bench.text('TSTART:') == 'OKAY'
    assert [tool.handle for tool in parse_tx(bench.text('TX:0001'))] == [0x0B]
    assert bench.text('TSTOP:') == 'OKAY'
    assert bench.text('PDIS:0B') == 'OKAY'
    assert bench.text('PHSR:04') == '00'


@pytest.mark.parametrize(
    ('before', 'command', 'error'),
    [
        ((), 'PHSR:00', '10'),
        ((), 'NONSENSE:', '01'),
        (('INIT:',), 'TX:0001', '0C'),
        (('INIT:',), 'PINIT:0F', '08'),
        (('INIT:',), 'PENA:0AD', '0E'),
        (('INIT:', 'PINIT:0A'), 'PENA:0AX', '09'),
        (('INIT:',), 'PINIT:XY', '07'),
        (('INIT:',), 'PHSR:09', '23'),
        (('INIT:', 'TSTART:'), 'PINIT:0A', '0C'),
        (('INIT:', 'TSTART:'), 'TX:1000', '23'),
        ((), 'COMM:90000', '06'),
    ],
)
def test_what_is_wrong_is_answered_by_its_error(before, command, error):
    bench = Bench()
    for earlier in before:
        assert bench.text(earlier) == 'OKAY'
    assert bench.text(command) == f'ERROR{error}'


def test_frames_come_at_40_hz_and_show_the_sensor_then():
    bench = Bench(lambda t: SensorView(position=(t, 0.0, -0.2)))
    bench.track()
    seen = []
    for k in range(200):
        bench.clock.seconds = 100.0 + 0.01 * k + 0.001
        tool = parse_tx(bench.text('TX:0001'))[0]
        seen.append((tool.frame, tool.position[0]))
    assert seen[-1][0] == 79
    assert len(set(seen)) == 80
    for frame, x in seen:
        assert x == pytest.approx(frame / 40.0, abs=1e-5)


def test_binary_and_text_say_the_same():
    view = SensorView((0.1, -0.05, -0.3), (0.5, -0.5, 0.5, 0.5), 0.0004)
    bench = Bench(lambda _: view)
    bench.track()
    reply = bench.say('BX:0801')
    header, body = reply[:6], reply[6:]
    assert header == struct.pack('<HHH', 0xA5C4, len(body) - 2, crc16(header[:4]))
    assert body[-2:] == struct.pack('<H', crc16(body[:-2]))
    count, handle, state, *values, status, frame, system = struct.unpack('<3B8fIIH', body[:-2])
    assert (count, handle, state, status, system) == (1, 0x0A, 1, 0x31, 0)
    assert values == pytest.approx((0.5, 0.5, -0.5, 0.5, 100.0, -50.0, -300.0, 0.4))
    tool = parse_tx(bench.text('TX:0801'))[0]
    assert tool.frame == frame
    assert tool.position == pytest.approx(view.position)
    assert tool.orientation == pytest.approx(view.orientation)
