"""Framing, stuffing and CRC, with vectors of the e-manual."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from endoscope_devices.dynamixel.control_table import CURRENT_LIMIT, GOAL_CURRENT, GOAL_POSITION
from endoscope_devices.dynamixel.packet import STATUS, Instruction, PacketReader, encode

# Manual: 'Protocol 2.0', Ping, Read, Status, Reboot; the last is a write whose data look like a
# header.
GOLDEN = [
    (1, Instruction.PING, '', 'fffffd00 01 0300 01 194e'),
    (1, Instruction.READ, '8400 0400', 'fffffd00 01 0700 02 84000400 1d15'),
    (1, STATUS, '00 a6000000', 'fffffd00 01 0800 55 00 a6000000 8cc0'),
    (1, Instruction.REBOOT, '', 'fffffd00 01 0300 08 2f4e'),
    (1, Instruction.WRITE, '7400 ffff fd00', 'fffffd00 01 0a00 03 7400 fffffdfd00 21e7'),
]


@pytest.mark.parametrize(('device', 'instruction', 'parameters', 'wire'), GOLDEN)
def test_golden_vectors_both_ways(device, instruction, parameters, wire):
    raw = bytes.fromhex(wire)
    assert encode(device, instruction, bytes.fromhex(parameters)) == raw
    (packet,) = PacketReader().feed(raw)
    assert packet[:3] == (device, instruction, bytes.fromhex(parameters))
    assert packet.size == len(raw)


@given(
    st.integers(0, 252),
    st.sampled_from([*Instruction, STATUS]),
    st.lists(st.sampled_from([b'\xff', b'\xfd', b'\x00', b'\x55']), max_size=200).map(b''.join),
    st.integers(1, 40),
)
def test_what_is_sent_in_any_pieces_is_what_is_read(device, instruction, parameters, piece):
    raw = encode(device, instruction, parameters)
    assert b'\xff\xff\xfd\x00' not in raw[4:-2]
    reader = PacketReader()
    packets = []
    stream = b'\xff\xff' + raw + raw
    for start in range(0, len(stream), piece):
        packets += reader.feed(stream[start : start + piece])
    assert [p[:3] for p in packets] == [(device, instruction, parameters)] * 2
    assert reader.wrong_crc == 0


def test_values_have_their_sign():
    assert GOAL_POSITION.decode(b'\xff\xff\xff\xff') == -1
    assert GOAL_CURRENT.encode(-1) == b'\xff\xff'
    assert GOAL_POSITION.decode(GOAL_POSITION.encode(-1_048_575)) == -1_048_575
    assert CURRENT_LIMIT.decode(b'\xa9\x04') == 1193
