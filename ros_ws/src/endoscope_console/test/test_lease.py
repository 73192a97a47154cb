import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from endoscope_console.clients import LEASE_SILENCE_NS, UNATTENDED_NS, Attendance, Lease

MS = 1_000_000


def test_a_sign_that_was_stamped_before_another_does_not_shorten_it():
    lease = Lease()
    lease.claim('c1', False, 1000 * MS)
    lease.heard('c1', 0)
    assert lease.turn(2500 * MS) == ''


def test_a_client_has_a_name():
    with pytest.raises(ValueError, match='name'):
        Lease().claim('', True, 0)


def test_a_session_that_lost_its_operator_is_paused_and_no_other():
    attendance = Attendance()
    assert not attendance.turn(0, 's1', False)
    assert not attendance.turn(9 * UNATTENDED_NS, 's1', False), 'another program has enabled it'
    assert not attendance.lacks
    begin = 10 * UNATTENDED_NS
    assert not attendance.turn(begin, 's2', True)
    assert not attendance.turn(begin + UNATTENDED_NS - 1, 's2', False)
    assert attendance.lacks
    assert attendance.turn(begin + UNATTENDED_NS, 's2', False)
    assert attendance.turn(begin + 2 * UNATTENDED_NS, 's2', False), 'it had no effect'
    assert not attendance.turn(begin + 2 * UNATTENDED_NS, 's2', True)
    assert not attendance.lacks
    assert not attendance.turn(begin + 9 * UNATTENDED_NS, '', False)
    assert not attendance.lacks


CLIENTS = st.sampled_from(['c1', 'c2', 'c3'])


class OneOperator(RuleBasedStateMachine):
    def __init__(self):
        super().__init__()
        self.lease = Lease()
        self.now = 0
        self.holder, self.since, self.heard = '', 0, 0

    @rule(client=CLIENTS, take=st.booleans())
    def claim(self, client, take):
        claim = self.lease.claim(client, take, self.now)
        assert claim.granted == (self.holder in ('', client) or take)
        assert bool(claim.why) == (not claim.granted)
        another = claim.granted and self.holder not in ('', client)
        assert claim.lost_by == (self.holder if another else '')
        if claim.granted:
            self.since = self.since if self.holder == client else self.now
            self.holder, self.heard = client, self.now

    @rule(client=CLIENTS)
    def go(self, client):
        self.lease.release(client)
        if client == self.holder:
            self.holder, self.since = '', 0

    @rule(client=CLIENTS)
    def sign(self, client):
        self.lease.heard(client, self.now)
        if client == self.holder:
            self.heard = self.now

    @rule(ms=st.sampled_from([1, 500, 999, 1000, 2000]))
    def time_goes_by(self, ms):
        self.now += ms * MS
        silent = bool(self.holder) and self.now - self.heard >= LEASE_SILENCE_NS
        assert self.lease.turn(self.now) == (self.holder if silent else '')
        if silent:
            self.holder, self.since = '', 0

    @invariant()
    def one_holds_it(self):
        assert (self.lease.holder, self.lease.since_ns) == (self.holder, self.since)


TestOneOperator = OneOperator.TestCase
TestOneOperator.settings = settings(max_examples=100, stateful_step_count=20)
