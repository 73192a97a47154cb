"""Whatever happens to the bytes on the line, no wrong value is taken for a true one."""

import random
import struct

from endoscope_devices.dynamixel.packet import STATUS, encode
from endoscope_devices.dynamixel.packet_handler import AnswerCollector
from endoscope_devices.dynamixel.servo_block import BLOCK_SIZE, BlockJudge, Doubt, decode_block

MS = 1_000_000
WATCHDOG = 5
IDS = (1, 2)


def block(k, device):
    """True bytes of a servo at millisecond k: moving, so that old values differ from new ones."""
    return struct.pack(
        '<Hbhii', (700 * device + k) % 32768, WATCHDOG, -3 - device, -20, 2048 + device + k % 7
    )


def answers(k):
    return [encode(device, STATUS, b'\0' + block(k, device)) for device in IDS]


def flipped(chance, raw, count):
    hurt = bytearray(raw)
    for _ in range(count):
        hurt[chance.randrange(len(hurt))] ^= 1 << chance.randrange(8)
    return bytes(hurt)


def burst(chance, raw):
    start = chance.randrange(len(raw))
    noise = bytes(chance.randrange(256) for _ in range(chance.randrange(1, 12)))
    return raw[:start] + noise + raw[start + len(noise) :]


def corrupted(chance, k):
    """The two answers of a cycle, damaged in one of many ways."""
    first, second = answers(k)
    old_first, old_second = answers(k - chance.randrange(5, 400))
    cut = chance.randrange(1, len(first))
    whole = first + second
    return chance.choice(
        [
            lambda: flipped(chance, whole, 1),
            lambda: flipped(chance, whole, 2),
            lambda: flipped(chance, whole, 3),
            lambda: flipped(chance, whole, chance.randrange(4, 80)),
            lambda: burst(chance, whole),
            lambda: whole[:cut] + whole[cut + chance.randrange(1, 5) :],
            lambda: whole[:cut] + bytes((chance.randrange(256),)) + whole[cut:],
            lambda: old_first + second,
            lambda: old_first + old_second + whole,
            lambda: first + first + second,
            lambda: second + first,
            lambda: first[:cut] + old_first[cut:] + second,
            lambda: first[:cut] + whole,
            lambda: bytes(chance.randrange(256) for _ in range(len(whole))),
            lambda: first + encode(2, STATUS, b'\0' + bytes(BLOCK_SIZE)),
            lambda: first + encode(2, STATUS, b'\x04'),
            lambda: whole[: -chance.randrange(1, len(whole))],
        ]
    )()


def test_of_twenty_thousand_corrupted_packets_none_gives_a_wrong_value():
    chance = random.Random(20)
    judges = {device: BlockJudge(8.0, 1.0) for device in IDS}
    corrupt = accepted = 0
    now = 10**12
    for k in range(1000, 21_000):
        now += MS
        asked, received = now - 700_000, now
        damaged = k % 2 == 0
        stream = corrupted(chance, k) if damaged else b''.join(answers(k))
        corrupt += 2 * damaged
        collector = AnswerCollector(IDS, BLOCK_SIZE)
        for start in range(0, len(stream), 16):
            collector.feed(stream[start : start + 16])
        for device, reply in collector.replies.items():
            if len(reply.data) != BLOCK_SIZE:
                continue
            verdict = judges[device].judge(decode_block(reply.data), WATCHDOG, asked, received)
            if isinstance(verdict, Doubt):
                continue
            accepted += 1
            assert reply.data == block(k, device), f'at {k}: a wrong value was taken'
        if not damaged:
            assert collector.complete
    assert corrupt == 20_000
    assert accepted > 20_000
