"""What the driver makes of sessions: no motion without an enable, no step too far."""

import math

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule

from endoscope_core.safety import (
    CommandLimits,
    MotionLimits,
    MotionSession,
    OperatingStateMachine,
    Refusal,
    ShaftMotion,
)

MS = 1_000_000
SPEED, STEP = 5.0, 0.1
COMMANDS = CommandLimits(1.6, 1.25 * SPEED, 0.1)
LIMITS = MotionLimits((-1.6, -1.6), (1.6, 1.6), SPEED, 250.0, STEP)


def moving_from(position):
    motion = ShaftMotion(COMMANDS, LIMITS)
    motion.measure(position)
    motion.session.hear('', 0)
    motion.session.hear('session-1', MS)
    return motion


def test_shafts_start_where_they_are_and_stop_where_they_are():
    motion = moving_from((0.4, -0.2))
    assert motion.turn(2 * MS, 1e-3) == (0.4, -0.2)
    assert motion.command('session-1', MS, (0.45, -0.2), (), 2 * MS) is None
    assert motion.goal == pytest.approx((0.4, -0.2), abs=SPEED * 1e-3)
    for t in range(3, 300):
        motion.turn(t * MS, 1e-3)
        motion.session.hear('session-1', t * MS)
    assert motion.holding
    assert motion.goal == pytest.approx((0.4, -0.2))


def test_a_stream_that_ends_in_motion_leads_no_further_than_it_came():
    motion = moving_from((0.0, 0.0))
    shaft = 0.0
    for t in range(2, 400):
        motion.session.hear('session-1', t * MS)
        if t < 200:
            assert motion.command('session-1', t * MS, (2e-3 * t, 0.0), (), t * MS) is None
        last = motion.goal[0]
        shaft += 0.01 * (motion.turn(t * MS, 1e-3)[0] - shaft)
        motion.measure((shaft, 0.0))
        if t > 200:
            assert motion.goal[0] <= last
    assert motion.holding
    assert motion.goal[0] < 0.36


def test_what_was_refused_as_too_fast_is_not_made_up_for():
    motion = moving_from((0.0, 0.0))
    asked = [0.0] * 10 + [0.015 * k for k in range(50)] + [0.735] * 300
    refused = 0
    for t, angle in enumerate(asked, start=2):
        before = motion.turn(t * MS, 1e-3)
        refused += motion.command('session-1', t * MS, (angle, 0.0), (), t * MS) is not None
        motion.session.hear('session-1', t * MS)
        assert abs(motion.goal[0] - before[0]) <= SPEED * 1e-3 + 1e-9
    assert refused > 20
    assert motion.goal[0] == pytest.approx(0.735)


class AnyInterleaving(RuleBasedStateMachine):
    """Supervisor, compensator, driver and shafts, and whatever may happen to them.

    What may move the shafts is kept beside, by the rule alone: `word` is the session that an
    operator's last word opened, and `valid` that session for the driver of now: it heard it being
    opened, and has neither stood still nor missed the supervisor since, nor taken anything from a
    second sender. A driver that stalls finds the newest command when it wakes, as in a queue of
    one: of a rival that spoke and was followed by the compensator it never hears.
    """

    def __init__(self):
        super().__init__()
        self.now = 10_000
        self.supervisor = OperatingStateMachine()
        self.stalled = {'supervisor': 0, 'compensator': 0, 'driver': 0}
        self.shaft = [0.3, -0.2]
        self.sent = []
        self.clutch = False
        self.way = 0.0
        self.speed = 0.0
        self.word = ''
        self.start_compensator()
        self.start_driver()
        self.run(100)

    def start_compensator(self):
        self.compensator = MotionSession()
        self.origin = None

    def start_driver(self):
        self.driver = ShaftMotion(COMMANDS, LIMITS)
        self.turned = self.obeyed = self.heard_at = self.came = self.now
        self.valid, self.heard, self.waiting = '', None, None

    def run(self, milliseconds):
        for _ in range(milliseconds):
            self.now += 1
            self.take()
            awake = {who: self.now >= until for who, until in self.stalled.items()}
            if self.supervisor is not None and awake['supervisor'] and self.now % 50 == 0:
                self.heartbeat(self.supervisor.session)
            if awake['compensator']:
                self.compensate()
            if awake['driver']:
                self.drive()

    def heartbeat(self, name, doubt=''):
        ns = self.now * MS
        if self.now >= self.stalled['compensator']:
            self.compensator.hear(name, ns, doubt)
        if self.now < self.stalled['driver']:
            return
        self.driver.session.hear(name, ns, doubt)
        if doubt:
            self.valid = ''
            return
        self.heard_at = self.now
        if self.word != self.heard:
            self.valid = self.word if self.heard is not None else ''
            self.heard = self.word

    def compensate(self):
        self.compensator.beat(self.now * MS)
        if not self.compensator.name or not self.clutch:
            self.origin = None
            return
        if self.origin is None:
            self.origin, self.way = tuple(self.shaft), 0.0
        self.way += 1e-3 * self.speed
        self.send(self.compensator.name, [max(-1.6, min(1.6, x + self.way)) for x in self.origin])

    def send(self, session, position, ahead_ms=0, doubt=''):
        stamp = (self.now + ahead_ms) * MS
        self.sent.append((session, stamp, tuple(position)))
        self.waiting = session, stamp, tuple(position), doubt
        self.take()

    def take(self):
        if self.waiting is None or self.now < self.stalled['driver']:
            return
        (session, stamp, position, doubt), self.waiting = self.waiting, None
        self.notice_what_ends_the_word()
        if doubt:
            self.valid = ''
        before, measured, now = self.driver.goal, tuple(self.shaft), self.now * MS
        refusal = self.driver.command(session, stamp, position, (), now, doubt)
        # A stream that paused may go on as fast as the bound, by its stamps.
        period = max(1, stamp // MS - self.came)
        if refusal in (None, Refusal.RATE):
            self.came = max(self.came, stamp // MS)
        if refusal is None:
            assert session, 'a command of no session was obeyed'
            assert session == self.valid, "a command was obeyed on nobody's word"
            assert not doubt
            self.obeyed = self.now
            self.judge(before, measured, period)

    def notice_what_ends_the_word(self):
        if self.now - self.turned > 100 or self.now - self.heard_at > 200:
            self.valid = ''

    def drive(self):
        self.notice_what_ends_the_word()
        period, self.turned = self.now - self.turned, self.now
        before, measured = self.driver.goal, tuple(self.shaft)
        goal = self.driver.turn(self.now * MS, period * 1e-3)
        self.judge(before, measured, period)
        if self.now - self.obeyed > 101 and goal:
            assert self.driver.holding, 'nobody commands, and the shafts are not held'
        if goal:
            blend = 1.0 - math.exp(-period / 30.0)
            self.shaft = [x + blend * (g - x) for x, g in zip(self.shaft, goal, strict=True)]
        self.driver.measure(self.shaft)

    def judge(self, before, measured, period):
        """The goal goes no faster than the bound, unless to where the shafts are."""
        if before and before != self.driver.goal:
            bound = min(STEP, SPEED * period * 1e-3) + 1e-9
            for old, new, here in zip(before, self.driver.goal, measured, strict=True):
                assert abs(new - old) <= bound or abs(new - here) <= SPEED * 1e-3 + 1e-9

    @rule(speed=st.sampled_from([0.0, 0.2, -1.0, 3.0]), ms=st.sampled_from([1, 30, 200]))
    def into_motion(self, speed, ms):
        """Bring everything to where there is something to lose."""
        self.supervisor = self.supervisor or OperatingStateMachine()
        self.stalled = dict.fromkeys(self.stalled, 0)
        self.run(60)
        if not self.word:
            self.supervisor.command('disable', self.now * MS)
            self.supervisor.command('enable', self.now * MS)
            self.word = self.supervisor.session
        self.speed, self.clutch = speed, True
        self.run(60 + ms)

    @rule(ms=st.integers(1, 400))
    def time_goes_on(self, ms):
        self.run(ms)

    @rule(command=st.sampled_from(['enable', 'enable', 'disable', 'pause', 'resume', 'home', 'go']))
    def operator(self, command):
        if self.supervisor is not None and self.supervisor.command(command, self.now * MS).accepted:
            if command in ('enable', 'resume'):
                self.word = self.supervisor.session
            elif command in ('disable', 'pause'):
                self.word = ''
        self.run(60)

    @rule(speed=st.floats(-8.0, 8.0), held=st.sampled_from([True, True, False]))
    def hand(self, speed, held):
        self.speed, self.clutch = speed, held
        self.run(50)

    @rule(seconds=st.sampled_from([1, 1, 1, 1, 60, 101, 101]))
    def rest(self, seconds):
        """Nobody moves for a while; whoever does then is obeyed."""
        self.into_motion(0.2, 30)
        self.clutch = False
        self.run(150)
        for _ in range(11 * seconds):
            self.now += 90
            self.heartbeat(self.supervisor.session)
            self.compensate()
            self.drive()
        obeyed, self.clutch = self.driver.gate.accepted, True
        self.run(60)
        if self.valid and self.compensator.name == self.valid:
            assert self.driver.gate.accepted > obeyed

    @rule()
    def fault(self):
        self.word = ''
        if self.supervisor is not None:
            self.supervisor.report_cause('x', 'x')
            self.supervisor.clear_cause('x')
        self.run(10)

    @rule(
        who=st.sampled_from(['supervisor', 'compensator', 'driver']),
        ms=st.sampled_from([20, 90, 110, 140, 210, 2000]),
        then=st.sampled_from([0, 10, 2100]),
    )
    def stall(self, who, ms, then):
        self.stalled[who] = self.now + ms
        self.run(then and ms + then)

    @rule()
    def kill_supervisor(self):
        self.supervisor = None
        self.word = ''

    @rule()
    def restart_supervisor(self):
        self.supervisor = OperatingStateMachine()
        self.word = ''

    @rule()
    def restart_compensator(self):
        self.start_compensator()

    @rule()
    def restart_driver(self):
        self.start_driver()

    @rule(position=st.floats(-1e9, 1e9) | st.sampled_from([math.nan, math.inf, 0.5]))
    def rival(self, position):
        self.send(self.driver.session.name, (position, position), doubt='2 senders')

    @rule(position=st.floats(-2.0, 2.0), ahead=st.sampled_from([0, -500, 20, 10_000, 10**11]))
    def leap(self, position, ahead):
        self.send(self.compensator.name, (position, position), ahead)

    @rule(which=st.integers(0, 10**6))
    def late_message(self, which):
        if self.sent:
            session, stamp, position = self.sent[which % len(self.sent)]
            self.send(session, position, stamp // MS - self.now)

    @rule(name=st.sampled_from(['', 'session-1', 'session-99999']))
    def rival_supervisor(self, name):
        self.heartbeat(name, '2 senders')


def test_a_rival_whose_command_waits_for_a_stalled_driver_ends_its_session():
    graph = AnyInterleaving()
    graph.into_motion(ms=200, speed=0.2)
    graph.stall('driver', 20, 0)
    graph.stall('compensator', 90, 0)
    obeyed = graph.driver.gate.accepted
    graph.rival(0.0)
    assert graph.driver.session.name
    graph.run(300)
    assert not graph.driver.session.name
    assert graph.driver.gate.refused[Refusal.SENDER] == 1
    assert graph.driver.gate.accepted == obeyed
    assert graph.driver.holding


def test_who_rests_for_an_hour_is_obeyed_when_they_move_again():
    AnyInterleaving().rest(seconds=3600)


TestAnyInterleaving = AnyInterleaving.TestCase
TestAnyInterleaving.settings = settings(max_examples=40, stateful_step_count=20, deadline=None)


def test_refusals_are_counted_by_reason():
    motion = ShaftMotion(COMMANDS, LIMITS)
    motion.measure((0.0, 0.0))
    assert motion.command('session-1', MS, (0.0, 0.0), (), MS) is Refusal.SESSION
    motion.session.hear('', MS)
    motion.session.hear('session-1', MS)
    assert motion.command('', MS, (0.0, 0.0), (), MS) is Refusal.SESSION
    assert motion.command('session-1', MS, (0.0, 0.0), (), MS, '2 senders') is Refusal.SENDER
    assert motion.command('session-1', MS, (0.0, 0.0), (), MS) is Refusal.SESSION
    assert motion.gate.refused[Refusal.SESSION] == 3
