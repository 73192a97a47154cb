"""Requests and replies as bytes: golden vectors, and replies that a line has spoilt."""

import random

import pytest
from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import ReadInputRegistersResponse

from endoscope_devices.load_cells.modbus_framing import (
    ReplyError,
    ReplyTrouble,
    RtuFraming,
    TcpFraming,
)

REGISTERS = (0, 5015, 0xFFFF, 0xFF38, 1, 0x86A0, 0, 8015)


def reply(framer, registers=REGISTERS, unit=1, transaction=0):
    pdu = ReadInputRegistersResponse(
        registers=list(registers), dev_id=unit, transaction_id=transaction
    )
    return framer(DecodePDU(True)).buildFrame(pdu)


def test_golden_requests():
    # Modbus over Serial Line V1.02: unit 17 asks for registers 107 to 109 by function 3.
    assert RtuFraming(17, 3).request(0x6B, 3).hex() == '1103006b00037687'
    assert TcpFraming(17, 3).request(0x6B, 3).hex() == '0001' + '0000' + '0006' + '1103006b0003'


def test_golden_reply():
    framing = RtuFraming(17, 3)
    framing.request(0x6B, 3)
    assert framing.accept(bytes.fromhex('110306ae415652434049ad')) == (0xAE41, 0x5652, 0x4340)


@pytest.mark.parametrize(
    ('data', 'trouble', 'words'),
    [
        (reply(FramerRTU, unit=2), ReplyTrouble.MALFORMED, 'from unit 2'),
        (reply(FramerRTU, REGISTERS[:7]), ReplyTrouble.MALFORMED, '16 bytes of function 4'),
        (reply(FramerRTU)[:-1] + b'\0', ReplyTrouble.CHECKSUM, '21 bytes'),
        (bytes.fromhex('018402c2c1'), ReplyTrouble.REFUSED, 'exception 2'),
        (b'\1\4', ReplyTrouble.MALFORMED, '2 bytes'),
    ],
)
def test_what_is_not_the_answer_is_refused(data, trouble, words):
    framing = RtuFraming(1, 4)
    framing.request(0, 8)
    with pytest.raises(ReplyError, match=words) as caught:
        framing.accept(data)
    assert caught.value.trouble is trouble


def test_a_tcp_reply_to_an_earlier_request_is_none():
    framing = TcpFraming(1, 4)
    framing.request(0, 8)
    framing.request(0, 8)
    assert framing.accept(reply(FramerSocket, transaction=1)) is None
    assert framing.accept(reply(FramerSocket, transaction=2)) == REGISTERS


def spoilt(data, rng):
    """What a bad line makes of a reply: flipped bits, bursts, lost, added and doubled bytes."""
    bad = bytearray(data)
    kind = rng.randrange(6)
    at = rng.randrange(len(bad))
    if kind == 0:
        for _ in range(rng.randint(1, 3)):
            bad[rng.randrange(len(bad))] ^= 1 << rng.randrange(8)
    elif kind == 1:
        bad[at : at + 2] = rng.randbytes(len(bad[at : at + 2]))
    elif kind == 2:
        del bad[at : at + rng.randint(1, 4)]
    elif kind == 3:
        bad[at:at] = rng.randbytes(rng.randint(1, 4))
    elif kind == 4:
        bad[at:at] = bad[at : at + rng.randint(1, 4)]
    else:
        return rng.randbytes(len(bad))
    return bytes(bad)


def test_no_wrong_value_in_20000_spoilt_rtu_replies():
    rng = random.Random(20261121)
    framing = RtuFraming(1, 4)
    framing.request(0, 8)
    refused = dict.fromkeys(ReplyTrouble, 0)
    same = 0
    for _ in range(20_000):
        registers = tuple(rng.randrange(65536) for _ in REGISTERS)
        whole = reply(FramerRTU, registers)
        data = spoilt(whole, rng)
        try:
            # As the reader does: it takes as many bytes as the first ones announce.
            accepted = framing.accept(data[: framing.length(data)])
        except ReplyError as error:
            refused[error.trouble] += 1
            continue
        same += 1
        assert accepted == registers
    assert sum(refused.values()) + same == 20_000
    assert refused[ReplyTrouble.CHECKSUM] > 10_000
    assert same < 1_000


def test_no_wrong_value_in_spoilt_tcp_headers():
    rng = random.Random(7)
    refused = 0
    for _ in range(10_000):
        framing = TcpFraming(1, 4)
        framing.request(0, 8)
        data = bytearray(reply(FramerSocket, transaction=1))
        # TCP has a checksum of its own for the data; Modbus adds none.
        data[rng.randrange(9)] ^= rng.randint(1, 255)
        try:
            accepted = framing.accept(bytes(data))
        except ReplyError:
            refused += 1
            continue
        assert accepted is None
    assert refused > 5_000
