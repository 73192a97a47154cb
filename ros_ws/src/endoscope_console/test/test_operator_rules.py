"""What an operator's dead-man never does, over sequences of everything that can happen to it."""

from collections import Counter
from dataclasses import replace

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule, run_state_machine_as_test
from page_in_virtual_time import MS, Page

from endoscope_console.teleop.frames import InputDevice
from endoscope_console.teleop.operator import DeadManState, Reason

OPEN, READY, ENGAGED = DeadManState
# So far apart that what is allowed for drifting clocks makes no difference.
ON_TIME_MS, A_LITTLE_LATE_MS, LATE_MS = 0, 40, 300
HANDS = st.fixed_dictionaries(
    {},
    optional={
        'turbo': st.booleans(),
        'visible': st.just(False),
        'focused': st.just(False),
        'position_mode': st.booleans(),
        'source': st.sampled_from(InputDevice),
        'x': st.sampled_from([-1.0, 0.05, 0.3]),
        'y': st.sampled_from([0.0, -0.05, 1.0]),
    },
)
CHANGES = (
    {'state_enabled': False},
    {'state_age_ns': 3499 * MS},
    {'state_age_ns': 3501 * MS},
    {'session': 'another'},
    {'calibrating': True},
    {'source': 'none'},
    {'source': 'file'},
    {'source': 'file', 'playing': True},
    {'holder': ''},
    {'holder': 'c2'},
)
EVER = Counter()


class AnOperator(RuleBasedStateMachine):
    """Keeps what has happened, and knows by that alone what the dead-man has to be."""

    def __init__(self):
        super().__init__()
        self.page = Page()
        self.dead_man = self.page.dead_man
        self.holder = 'c1'
        self.seqs, self.quickest, self.grips = {}, {}, {}
        self.newest = None
        self.sent = []
        self.arrived = self.turned = self.page.now
        self.hands_off = False
        self.new_grip = 0
        self.of_grip = self.of_master = ()
        self.of_session = ''
        self.ended = Counter()

    def forbidden(self):
        """What forbids motion, whatever the hand does."""
        page, conditions, frame = self.page, self.page.conditions, self.newest
        if frame is None or not conditions.holder:
            return {Reason.SILENT, Reason.LOST}
        since = page.now - 300 * MS
        sees = any(seq == frame.seen and made >= since for seq, made in page.pictures)
        return {
            reason
            for reason, holds in (
                (Reason.HIDDEN, not frame.visible),
                (Reason.UNFOCUSED, not frame.focused),
                (Reason.STATE, not conditions.state_enabled or page.state_age_ns > 3500 * MS),
                (Reason.CALIBRATION, conditions.calibrating),
                (Reason.SOURCE, conditions.source != 'master' and not conditions.playing),
                (Reason.BLIND, not sees),
            )
            if holds
        }

    def faults(self, frame, delay_ms, client):
        if frame.seq <= self.seqs.get(client, -1):
            return {Reason.ORDER}
        self.seqs[client] = frame.seq
        quickest = self.quickest.setdefault(client, delay_ms)
        if delay_ms - quickest > LATE_MS / 2:
            return {Reason.LATE}
        self.quickest[client] = min(quickest, delay_ms)
        return set()

    def ended_by(self, frame):
        """What of a frame ends the grip that is engaged."""
        now_says = frame.grip, frame.source, frame.position_mode
        gone = self.of_grip[1] == InputDevice.GAMEPAD != frame.source
        return {
            reason
            for reason, holds in (
                (Reason.SILENT, self.page.now - self.arrived >= 100 * MS),
                (Reason.HIDDEN, not frame.visible),
                (Reason.UNFOCUSED, not frame.focused),
                (Reason.UNPLUGGED, not frame.pressed and gone),
                (Reason.RELEASED, not frame.pressed and not gone),
                (Reason.RELEASED, frame.pressed and now_says != self.of_grip),
            )
            if holds
        }

    def has_ended(self, reasons):
        """Hold the dead-man to what ends a grip that was engaged: these reasons, if any."""
        if not reasons:
            assert self.dead_man.state is ENGAGED
            return
        assert self.dead_man.state is OPEN
        assert self.dead_man.reason in reasons
        self.ended[self.dead_man.reason] += 1
        EVER[self.dead_man.reason] += 1
        self.hands_off = False

    def hear(self, frame, delay_ms=0, client=None):
        client = client or self.page.client
        before = self.dead_man.state
        ends = self.ended_by(frame) if before is ENGAGED else set()
        self.dead_man.hear(frame, self.page.now, client)
        if client != self.holder:
            assert self.dead_man.state is before
            return
        ends |= (faults := self.faults(frame, delay_ms, client))
        self.arrived = self.page.now
        self.sent.append(frame)
        if Reason.ORDER not in faults:
            self.newest = frame
        is_new = frame.pressed and frame.grip > self.grips.get(client, 0)
        if is_new:
            self.grips[client] = frame.grip
        if before is ENGAGED:
            self.has_ended(ends)
        elif before is READY:
            assert self.dead_man.state is (OPEN if faults else READY)
            self.hands_off = not faults
            if is_new and not faults:
                self.new_grip = frame.grip
            elif not frame.pressed or frame.grip != self.new_grip:
                self.new_grip = 0
        else:
            assert self.dead_man.state is OPEN
            rests = abs(frame.x) < 0.1 and abs(frame.y) < 0.1
            self.hands_off = not (faults or frame.pressed) and (self.hands_off or rests)

    def turn(self, ms=1):
        for _ in range(ms):
            before = self.dead_man.state
            self.page.turn()
            self.judge(before)

    def judge(self, before):
        page, conditions = self.page, self.page.conditions
        stalled = page.now - self.turned > 100 * MS
        silent = page.now - self.arrived >= 100 * MS
        self.turned = page.now
        ends = set()
        if conditions.holder != self.holder:
            self.holder, self.newest, self.hands_off = conditions.holder, None, False
            self.quickest.pop(conditions.holder, None)
            ends.add(Reason.LOST)
        forbidden = self.forbidden()
        of_master = conditions.source, conditions.playing
        after = self.dead_man.state
        if before is ENGAGED:
            ends |= forbidden | ({Reason.STALLED} if stalled else set())
            ends |= {Reason.SILENT} if silent else set()
            ends |= {Reason.SOURCE} if of_master != self.of_master else set()
            ends |= {Reason.STATE} if conditions.session != self.of_session else set()
            self.has_ended(ends)
        elif before is OPEN:
            assert after is (READY if self.hands_off and not forbidden else OPEN)
            self.new_grip = 0
        elif self.new_grip and not (forbidden or stalled or silent):
            assert after is ENGAGED
            frame = self.newest
            self.of_grip = frame.grip, frame.source, frame.position_mode
            self.of_master, self.of_session = of_master, conditions.session
            EVER[ENGAGED] += 1
        else:
            assert after is (OPEN if forbidden or self.newest.pressed else READY)
            self.hands_off = after is READY
            self.new_grip = 0
        if after is ENGAGED:
            assert self.newest.pressed
            assert self.newest.grip == self.grips[self.holder]

    @rule(ms=st.integers(1, 45))
    def time_goes_by(self, ms):
        self.turn(ms)

    @rule(ms=st.sampled_from([99, 100, 310]))
    def nothing_comes(self, ms):
        self.turn(ms)

    @rule(ms=st.integers(1, 140))
    def the_beat_stands_still(self, ms):
        self.page.now += ms * MS

    @rule(frames=st.integers(1, 6))
    def the_hand_goes_on(self, frames):
        for _ in range(frames):
            self.hear(self.page.frame())
            self.turn(20)

    @rule(source=st.sampled_from([InputDevice.KEYBOARD, InputDevice.GAMEPAD]))
    def the_operator_takes_hold(self, source):
        page = self.page
        page.hand = replace(page.hand, pressed=False, visible=True, focused=True, source=source)
        page.hand = replace(page.hand, x=0.0, y=0.0)
        for _ in range(2):
            self.hear(page.frame())
            self.turn()
        page.hand = replace(page.hand, pressed=True, grip=page.hand.grip + 1)
        self.hear(page.frame())
        self.turn()

    @precondition(lambda self: self.dead_man.engaged)
    @rule(what=st.integers(0, 5), change=st.sampled_from(CHANGES))
    def a_grip_ends(self, what, change):
        page = self.page
        if what == 0:
            page.hand = replace(page.hand, pressed=False)
            self.hear(page.frame())
        elif what == 1:
            self.hear(page.frame(late_ns=LATE_MS * MS), LATE_MS)
        elif what == 2:
            self.hear(replace(page.frame(), seq=0))
        elif what == 3:
            page.draws = False
            self.the_hand_goes_on(17)
        else:
            page.learns(**change)
        self.turn()

    @rule(
        pressed=st.booleans(),
        grip=st.sampled_from([0, 0, 1, -1, -5]),
        hand=HANDS,
        delay_ms=st.sampled_from([ON_TIME_MS, ON_TIME_MS, A_LITTLE_LATE_MS, LATE_MS]),
        seq=st.sampled_from([0, 0, 0, 0, -1, -3]),
    )
    def anything_is_sent(self, pressed, grip, hand, delay_ms, seq):
        page = self.page
        page.hand = replace(page.hand, pressed=pressed, grip=max(0, page.hand.grip + grip))
        frame = page.frame(late_ns=delay_ms * MS, **hand)
        self.hear(replace(frame, seq=max(0, frame.seq + seq)), delay_ms)

    @precondition(lambda self: self.sent)
    @rule(count=st.integers(1, 8))
    def what_was_sent_before_comes_again(self, count):
        for old in self.sent[-count:]:
            frame = self.page.frame()
            self.hear(replace(old, seq=frame.seq, t=frame.t, seen=frame.seen))
            self.turn()

    @rule(change=st.sampled_from(CHANGES))
    def something_changes(self, change):
        self.page.learns(**change)

    @rule()
    def all_is_well(self):
        page = self.page
        page.draws = True
        changes = vars(Page().conditions) | {'holder': page.client}
        page.learns(**changes)
        self.turn()

    @rule()
    def the_page_stops_drawing(self):
        self.page.draws = False

    @rule(reason=st.sampled_from([Reason.MALFORMED, Reason.FLOOD]), other=st.booleans())
    def what_comes_is_refused(self, reason, other):
        self.refused(reason, 'c3' if other else self.page.client)

    @rule(other=st.booleans())
    def a_page_is_closed(self, other):
        client = 'c3' if other else self.page.client
        self.refused(Reason.CLOSED, client)
        for known in (self.seqs, self.quickest, self.grips):
            known.pop(client, None)

    def refused(self, reason, client):
        before = self.dead_man.state
        if reason is Reason.CLOSED:
            self.dead_man.closed(client)
        else:
            self.dead_man.refuse(reason, client)
        mine = client == self.holder
        if mine and before is ENGAGED:
            self.has_ended({reason})
        assert self.dead_man.state is (OPEN if mine else before)
        self.hands_off &= not mine

    @rule()
    def another_page_takes_over(self):
        self.page.client = 'c2' if self.page.client == 'c1' else 'c1'
        self.page.learns(holder=self.page.client)
        self.turn()

    @rule(hand=HANDS, pressed=st.booleans())
    def another_page_sends_too(self, hand, pressed):
        self.hear(self.page.frame(pressed=pressed, **hand), client='c3')

    def teardown(self):
        assert self.dead_man.counts == self.ended


def test_over_1000_sequences_it_is_what_has_happened_and_nothing_else():
    EVER.clear()
    run_state_machine_as_test(
        AnOperator, settings=settings(max_examples=1000, stateful_step_count=30)
    )
    assert EVER[ENGAGED] > 100
    assert len(EVER) > 10
