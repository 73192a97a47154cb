"""Velocities that another program commands: nothing moves that was not asked for, in any order."""

import math

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from endoscope_core.control.master_motion import MasterMotion
from endoscope_core.control.velocity_stream import WATCHDOG_NS
from endoscope_core.kinematics import TipVelocity
from endoscope_core.rig import shipped_rig
from endoscope_core.safety import BendingRange, Refusal

RIG = shipped_rig()
FACTS = RIG.joints
MS = 1_000_000
TICK_S = 1e-3
BRAKING = math.ceil(FACTS.hand_speed / FACTS.acceleration / TICK_S)
FAST = 1.001 * FACTS.hand_speed
BAD = ((math.nan, 0.0), (0.0, math.inf), (FAST, 0.0), (0.0, -1e6), (0.1,))
RATES = st.tuples(*[st.floats(-FACTS.hand_speed, FACTS.hand_speed)] * 2)
# As a stick is held, which comes to the end of the range.
HELD = st.sampled_from([(FACTS.hand_speed, 0.0), (-FACTS.hand_speed, FACTS.hand_speed)])


class Slave:
    """A slave that goes where the master has it go, and a program that commands velocities."""

    def __init__(self, pose=(0.0, 0.0)):
        self.pose, self.now_ns = pose, 1_000 * MS
        self.motion = MasterMotion(RIG, lambda: self.pose)
        self.motion.obey_velocities()
        self.sent = 0

    @property
    def stream(self):
        return self.motion.velocities

    def send(self, rate, ahead_ns=0):
        return self.stream.take(self.now_ns + ahead_ns, rate, self.now_ns)

    def tick(self, held=True, free=True):
        self.now_ns += MS
        desired = self.motion.next(self.now_ns, self.now_ns, 1, held=held, free=free)
        if desired is not None:
            self.pose = desired.position
        return desired

    def move(self, rate, ticks, every=20):
        """Send a velocity again and again; where the slave is to be, tick by tick."""
        found = []
        for k in range(ticks):
            if k % every == 0:
                assert self.send(rate) is None
            found.append(self.tick())
        return [desired for desired in found if desired is not None]


def test_it_goes_from_the_measured_pose_as_fast_as_asked():
    slave = Slave((0.3, -0.2))
    way = slave.move((0.5, -1.0), 501)
    assert way[0].position == pytest.approx((0.3, -0.2), abs=2e-3)
    assert slave.pose == pytest.approx((0.55, -0.7), abs=0.02)
    assert way[-1].velocity == (0.5, -1.0)


def test_the_watchdog_brakes_holds_and_says_that_it_ended():
    slave = Slave()
    slave.move((FACTS.hand_speed, 0.0), 300, every=1)
    last_ns = slave.now_ns - MS
    while slave.tick().velocity == (FACTS.hand_speed, 0.0):
        assert not slave.motion.velocities_ended(slave.now_ns)
    assert slave.now_ns - last_ns == WATCHDOG_NS + MS
    for _ in range(BRAKING + 5):
        slave.tick()
    held = slave.pose
    assert slave.motion.velocities_ended(slave.now_ns)
    assert slave.tick().position == held
    slave.motion.rest()
    assert not slave.motion.velocities_ended(slave.now_ns)
    assert slave.tick() is None


def test_it_stops_at_the_end_of_the_range():
    slave = Slave((1.5, 0.0))
    slave.move((FACTS.hand_speed, 0.0), 1000)
    assert slave.pose[0] == pytest.approx(FACTS.reach, abs=1e-6)


def test_it_stops_before_the_end_of_the_tubes_range_and_says_so():
    slave = Slave()
    slave.motion.ranges = (BendingRange(-0.6, 0.4), BendingRange(-2.0, 2.0))
    way = slave.move((FACTS.hand_speed, FACTS.hand_speed), 1000)
    assert max(desired.position[0] for desired in way) <= 0.4 + 1e-9
    assert slave.pose == pytest.approx((0.4, FACTS.reach), abs=1e-6)
    assert slave.motion.cut.report().startswith('this tube can be bent')


def test_after_a_stall_it_goes_on_from_rest_and_where_it_was():
    slave = Slave()
    slave.move((1.0, 0.0), 200)
    before = slave.pose
    slave.now_ns += 99 * MS
    slave.send((0.0, 0.0))
    found = slave.motion.next(slave.now_ns, slave.now_ns, 100, held=True, free=True)
    assert found.position == before


def test_a_tip_that_turns_in_its_own_frame_bends():
    slave = Slave((0.4, 0.0))
    asked = TipVelocity((0.0, 0.0, 5e-3), (0.0, 0.5, 0.0))
    for _ in range(200):
        assert slave.stream.take_tip(slave.now_ns, asked, slave.now_ns, slave.motion.where) is None
        slave.tick()
    assert slave.pose == pytest.approx((0.5, 0.0), abs=5e-3)
    assert slave.stream.ignored == 'linear.z'
    slave.send((0.0, 0.0))
    assert not slave.stream.ignored


def test_what_is_given_up_before_its_watchdog_is_braked_until_it_is_heard_again():
    slave = Slave()
    slave.move((1.0, 0.0), 200)
    slave.stream.lose()
    for _ in range(BRAKING):
        slave.tick()
    assert slave.motion.velocities_ended(slave.now_ns)
    assert slave.move((1.0, 0.0), 100)[-1].velocity == (1.0, 0.0)


@pytest.mark.parametrize(
    ('bending', 'reason'), [(None, 'no measured position'), ((3.0, 2.0), 'half a turn')]
)
def test_a_tip_of_unknown_place_is_not_moved(bending, reason):
    slave = Slave()
    asked = TipVelocity((0.0, 0.0, 0.0), (0.0, 0.5, 0.0))
    assert slave.stream.take_tip(slave.now_ns, asked, slave.now_ns, bending) is not None
    assert reason in slave.stream.gate.last_reason
    assert slave.tick() is None


def test_a_velocity_of_the_tip_that_is_no_number_is_refused():
    slave = Slave()
    asked = TipVelocity((0.0, 0.0, math.nan), (0.0, 0.5, 0.0))
    refusal = slave.stream.take_tip(slave.now_ns, asked, slave.now_ns, slave.pose)
    assert refusal is Refusal.NOT_FINITE


def test_what_is_too_fast_is_refused_with_both_speeds_and_ends_in_words():
    slave = Slave()
    for _ in range(400):
        assert slave.send((0.0, FAST)) is Refusal.RANGE
        assert slave.tick() is None
    assert slave.stream.gate.last_reason == 'out of range: 3.003 rad/s beyond 3'
    assert 'commands are refused' in slave.stream.gate.unheeded


class AnyOrder(RuleBasedStateMachine):
    """A program, its clutch and who else has the slave, in any order.

    What may move is kept beside, by the rule alone: `asked` is the newest velocity that was obeyed,
    and `asked_ns` its time.
    """

    def __init__(self):
        super().__init__()
        self.slave = Slave((0.3, -0.2))
        self.asked, self.asked_ns = None, 0
        self.held = self.free = True
        self.speed = (0.0, 0.0)

    @rule(rate=RATES | HELD, ahead=st.sampled_from([0, 0, 0, -300 * MS, 10_000 * MS]))
    def send(self, rate, ahead):
        if self.slave.send(rate, ahead) is None:
            self.asked, self.asked_ns = rate, self.slave.now_ns

    @rule(rate=st.sampled_from(BAD))
    def send_what_is_refused(self, rate):
        accepted = self.slave.stream.gate.accepted
        assert self.slave.send(rate) is not None
        assert self.slave.stream.gate.accepted == accepted

    @rule(held=st.booleans())
    def grip(self, held):
        self.held = held

    @rule(free=st.booleans())
    def open_or_end(self, free):
        self.free = free
        self.slave.motion.rest()
        self.asked, self.speed = None, (0.0, 0.0)

    @rule(ticks=st.integers(1, 400))
    def go_on(self, ticks):
        for _ in range(ticks):
            self.tick()

    @rule(ticks=st.integers(1, 200), rate=HELD)
    def stream(self, ticks, rate):
        for _ in range(ticks):
            self.send(rate, 0)
            self.tick()

    def tick(self):
        before, speed = self.slave.pose, self.speed
        desired = self.slave.tick(self.held, self.free)
        if desired is None:
            if not (self.held and self.free):
                self.asked = None
            self.speed = (0.0, 0.0)
            return
        assert self.held
        assert self.free
        wanted = self.asked if self.asked is not None else (0.0, 0.0)
        if self.slave.now_ns - self.asked_ns > WATCHDOG_NS:
            wanted = (0.0, 0.0)
        self.speed = tuple(
            (now - then) / TICK_S for now, then in zip(desired.position, before, strict=True)
        )
        for now, then, asked in zip(self.speed, speed, wanted, strict=True):
            assert abs(now) <= FACTS.hand_speed + 1e-6
            assert abs(now - then) <= FACTS.acceleration * TICK_S + 1e-6
            # Towards what is asked for, or braking, and never beyond either.
            assert min(then, asked, 0.0) - 1e-6 <= now <= max(then, asked, 0.0) + 1e-6

    @invariant()
    def within_reach(self):
        assert max(map(abs, self.slave.pose)) <= FACTS.reach + 1e-9


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(max_examples=30, stateful_step_count=20, deadline=None)
