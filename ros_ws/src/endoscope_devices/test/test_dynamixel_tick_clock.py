"""Freshness of readings by the servo's own clock."""

import random

from endoscope_devices.dynamixel.servo_block import BlockJudge, Freshness, ServoBlock, TickClock

MS = 1_000_000


class Servo:
    """A servo's clock that runs a little fast, in our time."""

    def __init__(self, rate=1.005, start=31_000):
        self._rate = rate
        self._start = start

    def tick(self, at_ns):
        return (self._start + int(at_ns * self._rate / MS)) % 32768


def test_true_readings_are_new_or_of_the_same_tick_whatever_the_host_does():
    servo, clock, chance = Servo(), TickClock(), random.Random(2)
    now = 10**12
    verdicts = []
    for _ in range(20_000):
        asked = now
        taken = asked + chance.randrange(100_000, 900_000)
        stall = chance.choice((0, 0, 0, 15 * MS)) * (chance.random() < 0.02)
        received = taken + chance.randrange(100_000, 400_000) + stall
        verdicts.append(clock.judge(servo.tick(taken), asked, received))
        if verdicts[-1] is Freshness.NEW:
            assert abs(clock.taken_ns(servo.tick(taken)) - taken) < 2.5 * MS
        now = received + chance.randrange(0, 2 * MS)
    assert set(verdicts) <= {Freshness.NEW, Freshness.SAME_TICK}
    assert verdicts.count(Freshness.NEW) > 10_000


def running(seconds=0.2):
    servo, clock = Servo(), TickClock()
    now = 5 * 10**11
    for _ in range(round(seconds * 1000)):
        assert clock.judge(servo.tick(now + 400_000), now, now + 800_000) is Freshness.NEW
        now += MS
    return servo, clock, now


def test_a_late_answer_is_old():
    servo, clock, now = running()
    for late in (3, 5, 20, 500):
        assert clock.judge(servo.tick(now - late * MS), now, now + MS // 2) is Freshness.OLD


def test_a_counter_that_began_anew_has_jumped():
    _, clock, now = running()
    for tick in (0, 17, 400, 20_000):
        verdict = clock.judge(tick, now, now + MS // 2)
        assert verdict in (Freshness.OLD, Freshness.AHEAD)


def test_a_clock_that_stands_still_is_noticed():
    servo, clock, now = running()
    tick = servo.tick(now + 400_000)
    assert clock.judge(tick, now, now + 800_000) is Freshness.NEW
    verdicts = [clock.judge(tick, now + k * MS, now + (k + 1) * MS) for k in range(1, 20)]
    assert Freshness.NEW not in verdicts
    assert set(verdicts[3:]) == {Freshness.OLD}


def test_after_a_long_silence_the_next_tick_is_taken_as_it_is():
    _, clock, now = running()
    assert clock.judge(12, now + 10**10, now + 10**10 + MS) is Freshness.NEW


def test_a_shaft_that_cannot_have_come_there_is_not_believed():
    judge, servo, now = BlockJudge(8.0, 1.0), Servo(), 5 * 10**11
    for k, angle in enumerate((0.0, 0.0, 0.02, 0.1)):
        asked = now + 2 * k * MS
        block = ServoBlock(servo.tick(asked + 400_000), 5, 0.0, 0.0, angle)
        verdict = judge.judge(block, 5, asked, asked + 800_000)
        assert (verdict is Freshness.NEW) == (angle < 0.1), verdict
