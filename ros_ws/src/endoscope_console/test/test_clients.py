"""Limits of the pages that are connected."""

import asyncio
from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from endoscope_console.access import OPERATOR, VIEWER
from endoscope_console.clients import (
    FRAMES_A_SECOND,
    OF_A_KIND,
    UNANSWERED,
    VIEWERS_OF_A_KIND,
    Client,
    Clients,
    FrameRate,
    Outbox,
)

SECOND = 1_000_000_000


@given(st.lists(st.integers(0, SECOND // 10), min_size=1, max_size=500))
def test_no_more_frames_than_allowed_in_any_second(gaps):
    rate, now, allowed = FrameRate(FRAMES_A_SECOND), 0, []
    for gap in gaps:
        now += gap
        if not rate.exceeded(now):
            allowed.append(now)
    for begin in allowed:
        within = sum(begin <= time < begin + SECOND for time in allowed)
        assert within <= 2 * FRAMES_A_SECOND


def test_a_hand_at_fifty_hertz_with_a_burst_is_no_flood():
    rate = FrameRate(FRAMES_A_SECOND)
    times = sorted([k * SECOND // 50 for k in range(500)] + [5 * SECOND] * 100)
    assert not any(rate.exceeded(time) for time in times)
    assert any(rate.exceeded(10 * SECOND + k) for k in range(FRAMES_A_SECOND + 1))


def test_a_slow_client_gets_the_newest_pictures_and_the_newest_state():
    async def run():
        box = Outbox()
        box.put_state('old')
        for k in range(5):
            box.put_picture(bytes([k]))
        box.put_state('new')
        return [await box.get() for _ in range(3)], box.dropped

    assert asyncio.run(run()) == (['new', b'\x03', b'\x04'], 3)


def test_whoever_waits_gets_what_comes():
    async def run():
        box = Outbox()
        waiting = asyncio.create_task(box.get())
        await asyncio.sleep(0)
        box.put_picture(b'one')
        return await waiting

    assert asyncio.run(run()) == b'one'


def test_so_many_pages_and_no_more():
    counts = Counter()
    clients = Clients(counts)
    viewers = [clients.admit('telemetry', VIEWER, 'here') for _ in range(VIEWERS_OF_A_KIND + 1)]
    assert [isinstance(one, Client) for one in viewers] == [True] * VIEWERS_OF_A_KIND + [False]
    others = [clients.admit('telemetry', OPERATOR, 'here') for _ in range(OF_A_KIND)]
    admitted = [one for one in others if isinstance(one, Client)]
    assert len(admitted) == OF_A_KIND - VIEWERS_OF_A_KIND
    assert isinstance(clients.admit('command', OPERATOR, 'here'), Client)
    clients.leave(admitted[0])
    assert isinstance(clients.admit('telemetry', OPERATOR, 'here'), Client)
    names = [client.id for client in (*clients.of('telemetry'), *clients.of('command'))]
    assert len(set(names)) == len(names) == OF_A_KIND + 1
    assert counts['refused: too many viewers'] == 1
    assert counts['refused: too many clients'] == VIEWERS_OF_A_KIND


def test_so_many_without_a_hello():
    clients = Clients(Counter())
    assert all(clients.knock() for _ in range(UNANSWERED))
    assert not clients.knock()
    clients.answered()
    assert clients.knock()
