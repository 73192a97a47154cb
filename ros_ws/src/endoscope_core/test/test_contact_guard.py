"""The guard of the force at the tip: it slows what pushes, and never moves by itself."""

import math

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from endoscope_core.safety import ContactGuard, FeltForce, GuardState
from endoscope_core.safety.contact_guard import CERTAIN, SILENT_NS

LIMIT, SPEED, RELEASE, LEVER = 0.1, 0.002, 0.005, 0.01
MS = 1_000_000
NAN = math.nan
MOST, RELEASED = SPEED / LEVER * 1e-3, RELEASE / LEVER * 1e-3
ROUNDING = 1e-12


class Bench:
    """A guard whose first joint is commanded and felt."""

    def __init__(self):
        self.guard = ContactGuard(('bend_x', 'bend_y'), LIMIT, SPEED, RELEASE, lambda _: LEVER)
        self.now_ns, self.sent = 1_000 * MS, 0.0
        self.guard.begin((0.0, 0.0), self.now_ns)

    def feel(self, *forces, half_width=0.02):
        """Estimates one after the other; a single one is so often that it is certain."""
        for force in forces if len(forces) > 1 else forces * CERTAIN:
            half_width += 1e-6
            low, high = force - half_width, force + half_width
            self.guard.feel(FeltForce(self.now_ns, (force, NAN), (low, NAN), (high, NAN)))

    def go(self, *targets):
        """What is sent for the last of the targets, one a millisecond."""
        for target in targets:
            self.now_ns += MS
            (self.sent, _), _ = self.guard((target, 0.0), (), 1e-3, self.now_ns)
        return self.sent

    def wait(self, ms):
        self.now_ns += ms * MS
        self.guard.look(self.now_ns)


def ramp(begin, end, ms=100):
    return [begin + (end - begin) * (k + 1) / ms for k in range(ms)]


def test_off_until_a_force_is_known_and_it_says_why():
    bench = Bench()
    assert bench.guard.in_words() == 'off: no force is known'
    bench.feel(0.0)
    assert bench.guard.in_words() == 'watching'
    assert bench.guard.joints == ('bend_x',)
    bench.wait(SILENT_NS // MS + 1)
    assert bench.guard.in_words() == 'off: the force is silent'
    bench.feel(0.0, half_width=0.2)
    assert bench.guard.in_words() == 'off: its bounds are wider than the limit'


def test_off_and_watching_pass_what_they_are_given():
    bench = Bench()
    given = (0.1 + 0.2, -1e-17), (0.3, 0.0)
    bench.now_ns += MS
    assert bench.guard(*given, 1e-3, bench.now_ns) == given
    bench.feel(0.0)
    assert bench.guard((2.0, -2.0), (), 1e-3, bench.now_ns) == ((2.0, -2.0), ())


def test_against_the_force_it_goes_on_at_contact_speed_and_with_it_freely():
    bench = Bench()
    bench.go(*ramp(0.0, 0.5))
    bench.feel(-0.31)
    assert bench.guard.in_words() == (
        'yielding: bend_x pushes with 0.31 N (limit 0.10 N): towards the contact only at 2 mm/s'
    )
    assert bench.go(*ramp(0.5, 0.8)) == pytest.approx(0.5 + 100 * MOST)
    assert bench.go(0.3) == 0.3
    assert bench.guard.state is GuardState.YIELDING
    # Not the other joint, and not the other direction.
    (_, other), speeds = bench.guard((-1.0, 1.0), (-2.0, 3.0), 1e-3, bench.now_ns)
    assert (other, speeds) == (1.0, (-2.0, 3.0))


def test_a_hand_that_rests_is_not_caught_up_with_above_the_limit_but_below_it():
    bench = Bench()
    bench.go(*ramp(0.0, 0.5))
    bench.feel(-0.2)
    held = bench.go(*ramp(0.5, 0.8))
    # It trembles, and goes no further.
    assert bench.go(*[0.79, 0.8] * 50) == held
    bench.feel(-0.05)
    assert bench.go(*[0.8] * 100) == pytest.approx(held + 100 * MOST)
    assert bench.guard.state is GuardState.YIELDING


def test_when_the_obstacle_gives_way_the_slave_does_not_leap():
    bench = Bench()
    bench.go(*ramp(0.0, 0.5))
    bench.feel(-0.2)
    bench.go(*ramp(0.5, 1.0))
    bench.feel(0.0)
    assert bench.guard.in_words() == (
        'yielding: nothing pushes bend_x any more: follows the hand at 5 mm/s'
    )
    before = bench.sent
    assert bench.go(1.0) - before == pytest.approx(RELEASED)
    # It may be more than the limit, and may be nothing.
    bench.guard.feel(FeltForce(bench.now_ns, (-0.11, NAN), (-0.2, NAN), (0.0, NAN)))
    before = bench.sent
    assert bench.go(1.0, 1.01) - before == pytest.approx(MOST)
    bench.feel(0.0)
    bench.go(bench.sent)
    assert bench.guard.in_words() == 'watching'
    assert bench.go(1.0) == 1.0


def test_a_force_that_changes_sides_gives_no_debt_free():
    bench = Bench()
    bench.go(*ramp(0.0, 0.5))
    bench.feel(-0.2)
    before = bench.go(*ramp(0.5, 1.0))
    bench.feel(0.2)
    assert bench.go(1.0) - before <= RELEASED + ROUNDING
    before = bench.sent
    assert before - bench.go(0.0) == pytest.approx(MOST)


def test_without_an_estimate_it_yields_until_the_hand_turns_back_and_is_off_then():
    bench = Bench()
    bench.go(*ramp(0.0, 0.5))
    bench.feel(-0.2)
    held = bench.go(*ramp(0.5, 0.8))
    bench.wait(SILENT_NS // MS + 1)
    assert bench.go(*[0.8] * 500) == held
    words = bench.guard.in_words()
    assert words.startswith('yielding: bend_x pushed with 0.20 N')
    assert words.endswith('now the force is silent')
    bench.go(0.4)
    assert bench.guard.in_words() == 'off: the force is silent'


def test_a_hand_that_rests_when_the_estimate_falls_silent_has_not_turned_back():
    bench = Bench()
    bench.go(*ramp(0.0, 0.5))
    bench.feel(-0.2)
    bench.wait(SILENT_NS // MS + 1)
    bench.go(*[0.5] * 10)
    assert bench.guard.state is GuardState.YIELDING


@pytest.mark.parametrize(('force', 'held'), [(-0.2, True), (-0.05, False)])
def test_a_new_stream_owes_nothing_and_keeps_the_direction_that_is_pushed(force, held):
    bench = Bench()
    bench.go(*ramp(0.0, 0.5))
    bench.feel(-0.2)
    bench.go(*ramp(0.5, 1.0))
    bench.feel(force)
    bench.guard.begin((0.45, 0.0), bench.now_ns)
    assert bench.go(0.45) == 0.45
    assert (bench.go(0.6) < 0.46) == held


def test_a_force_that_is_not_certain_or_below_the_limit_is_only_watched():
    bench = Bench()
    for force, half_width in ((-0.2, 0.3), (-0.09, 0.01)):
        bench.feel(force, half_width=half_width)
        assert bench.guard.state is not GuardState.YIELDING, force
    # The same one again, of a joint at rest and by another lever.
    for lever in (1.0, 1.001, 0.999):
        force, low, high = (-0.2 * lever, NAN), (-0.25 * lever, NAN), (-0.15 * lever, NAN)
        bench.guard.feel(FeltForce(bench.now_ns, force, low, high))
    assert bench.guard.state is not GuardState.YIELDING
    # Never twice in a row on one side, nor with silence between.
    bench.feel(0.0, -0.2, 0.2, -0.2, 0.0, -0.2, NAN, -0.2)
    bench.wait(SILENT_NS // MS + 1)
    bench.feel(-0.2, 0.0)
    assert bench.guard.state is not GuardState.YIELDING
    bench.feel(math.inf)
    assert bench.guard.state is not GuardState.YIELDING


def test_it_has_to_know_where_a_stream_begins():
    guard = ContactGuard(('bend_x', 'bend_y'), LIMIT, SPEED, RELEASE, lambda _: LEVER)
    with pytest.raises(RuntimeError, match='begin first'):
        guard((0.0, 0.0), (), 1e-3, 0)


ANGLES = st.floats(-1.5, 1.5)
FORCES = st.one_of(st.floats(-0.5, 0.5), st.sampled_from([NAN, math.inf]))


class AnyHand(RuleBasedStateMachine):
    """Any forces, whoever says them, and any commands."""

    def __init__(self):
        super().__init__()
        self.guard = ContactGuard(('bend_x', 'bend_y'), LIMIT, SPEED, RELEASE, lambda _: LEVER)
        self.now_ns = 1_000 * MS
        self.sent = None
        self.asked = (0.0, 0.0)
        # Signs of both forces where the newest one is certain, and where several in a row are above
        # the limit.
        self.certain = self.pushed = ()
        self.felt_ns = 0

    @rule(angle=ANGLES)
    def begin(self, angle):
        self.guard.begin((angle, 0.0), self.now_ns)
        self.sent = self.asked = (angle, 0.0)

    @rule()
    def end(self):
        self.guard.end()
        self.sent = None

    @rule(
        force=FORCES,
        half_width=st.floats(-0.01, 0.4),
        count=st.integers(1, 3),
        age_ms=st.integers(0, 400),
    )
    def feel(self, force, half_width, count, age_ms):
        both = (force, -force)
        low, high = (tuple(f + w for f in both) for w in (-half_width, half_width))
        age_ns = age_ms * MS
        for more in range(count, 0, -1):
            wider = tuple(x - 1e-6 * more for x in low), tuple(x + 1e-6 * more for x in high)
            self.guard.feel(FeltForce(self.now_ns - age_ns, both, *wider))
        if self.now_ns - age_ns < self.felt_ns:
            return
        sign = math.copysign(1.0, force)
        self.felt_ns = self.now_ns - age_ns
        certain = 0.0 <= half_width < abs(force) - 1e-5 < math.inf
        self.certain = (sign, -sign) if certain else ()
        self.pushed = self.certain if count >= CERTAIN and abs(force) > LIMIT else ()

    @rule(ms=st.integers(0, 500))
    def wait(self, ms):
        self.now_ns += ms * MS
        self.guard.look(self.now_ns)

    @precondition(lambda self: self.sent is not None)
    @rule(angle=ANGLES, count=st.integers(1, 5), stated=st.booleans())
    def command(self, angle, count, stated):
        for _ in range(count):
            self.now_ns += MS
            yielding = self.guard.state is GuardState.YIELDING
            target = (angle, -angle)
            speeds = (0.1, 0.2) if stated else ()
            sent, velocity = self.guard(target, speeds, 1e-3, self.now_ns)
            for before, now, wanted in zip(self.sent, sent, target, strict=True):
                # Between what was sent before and what is asked for: it never moves by itself.
                assert min(before, wanted) <= now <= max(before, wanted)
            assert len(velocity) == len(speeds)
            if not yielding:
                assert (sent, velocity) == (target, speeds)
            for k, (before, now) in enumerate(zip(self.sent, sent, strict=True)):
                fresh = self.now_ns - self.felt_ns <= SILENT_NS
                if self.pushed and fresh:
                    assert self.pushed[k] * (before - now) <= MOST + ROUNDING
                owed = self.asked[k] - before
                if owed:
                    side = math.copysign(1.0, owed)
                    against = fresh and self.certain and self.certain[k] == -side
                    most = MOST if against else RELEASED
                    assert side * (now - before) <= most + ROUNDING
            assert self.guard.state is GuardState.YIELDING or sent == target
            self.sent, self.asked = sent, target

    @invariant()
    def says_what_it_does(self):
        words = self.guard.in_words()
        assert words.startswith(self.guard.state)
        assert bool(self.guard.joints) == (self.guard.state is not GuardState.OFF)


AnyHand.TestCase.settings = settings(max_examples=150, stateful_step_count=40, deadline=None)
TestAnyHand = AnyHand.TestCase
