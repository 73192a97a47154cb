"""The last messages in memory: never older or larger than asked for, and what was in force."""

import tracemalloc

import numpy as np
import pytest

from endoscope_bags.recent_messages import RecentMessages, packed, unpacked
from endoscope_bags.recording_session import Arrival

MS = 10**6
SECOND = 10**9
STREAM, STATE = 0, 7


def arrival(ms, topic=STREAM, size=100, sequence=1):
    return Arrival(ms * MS, topic, sequence, ms * MS - 5, bytes([ms % 256]) * size)


def all_of(recent):
    return [message for piece in recent.pieces for message in unpacked(piece)]


def bytes_held(recent):
    """All messages that it gives, without what of them it refers to twice."""
    return sum(map(len, recent.pieces)) + sum(len(m.data) for m in recent.in_force_before)


def test_arrivals_come_out_as_they_went_in():
    batch = [Arrival(-1, 65535, 2**32 - 1, 2**62, b''), arrival(3, size=1000), arrival(1)]
    assert list(unpacked(packed(batch))) == batch
    assert list(unpacked(b'')) == []


def test_what_is_too_old_is_forgotten():
    recent = RecentMessages(2.0, 10**9)
    for ms in range(5000):
        recent.add([arrival(ms)], (), ms * MS)
    times = [message.received_ns for message in all_of(recent)]
    assert times == [ms * MS for ms in range(2999, 5000)]
    assert recent.seconds == pytest.approx(2.0)
    # Time goes on without messages, too.
    recent.add([], (), 100 * SECOND)
    assert all_of(recent) == []
    assert recent.size == 0


def test_a_flood_does_not_grow_beyond_the_capacity():
    capacity = 40_000_000
    recent = RecentMessages(20.0, capacity)
    largest, sizes = 0, np.random.default_rng(1).integers(1, 400_000, size=2000).tolist()
    for ms, size in enumerate(sizes):
        recent.add([arrival(ms, size=size), arrival(ms, STATE, size // 2)], {STATE}, ms * MS)
        assert bytes_held(recent) <= recent.size <= capacity
        largest = max(largest, recent.size)
    assert largest > 0.9 * capacity
    # What is left is the newest.
    assert all_of(recent)[-1].received_ns == (len(sizes) - 1) * MS
    assert recent.left_out == 0


def test_small_messages_take_little_more_than_their_bytes():
    capacity = 2_000_000
    recent = RecentMessages(20.0, capacity)
    tracemalloc.start()
    try:
        for ms in range(0, 20_000, 2):
            recent.add([arrival(ms, size=150) for _ in range(9)], (), ms * MS)
        taken, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert 0.9 * capacity < recent.size <= capacity
    assert taken < 1.25 * capacity


def test_a_message_larger_than_the_capacity_is_left_out_alone():
    recent = RecentMessages(20.0, 1000)
    recent.add([arrival(1), arrival(2, size=5000), arrival(3)], (), 3 * MS)
    assert [message.received_ns // MS for message in all_of(recent)] == [1, 3]
    assert recent.left_out == 1
    assert recent.size <= 1000


def test_states_larger_than_the_capacity_do_not_stay_for_ever():
    recent = RecentMessages(0.001, 1000)
    for topic in range(100):
        recent.add([arrival(topic * 10, topic, 90)], set(range(100)), topic * 10 * MS)
        assert bytes_held(recent) <= recent.size <= 1000
    assert recent.in_force_before


def test_what_was_in_force_before_is_kept_however_long_ago_it_came():
    recent = RecentMessages(1.0, 10**9)
    recent.add([arrival(0, STATE, sequence=1)], {STATE}, 0)
    recent.add([arrival(1, STATE, sequence=2)], {STATE}, MS)
    for ms in range(2, 9000):
        recent.add([arrival(ms)], {STATE}, ms * MS)
    assert [m.sequence for m in recent.in_force_before] == [2]
    assert [m.sequence for m in recent.in_force] == [2]
    recent.add([arrival(9000, STATE, sequence=3)], {STATE}, 9 * SECOND)
    # Before the oldest piece still the one, now the other.
    assert [m.sequence for m in recent.in_force_before] == [2]
    assert [m.sequence for m in recent.in_force] == [3]


def test_with_no_seconds_only_what_is_in_force_is_kept():
    recent = RecentMessages(0.0, 10**6)
    recent.add([arrival(0), arrival(0, STATE, sequence=4)], {STATE}, 0)
    assert recent.pieces == []
    assert [m.sequence for m in recent.in_force] == [4]
