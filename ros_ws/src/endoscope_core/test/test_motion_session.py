"""Motion sessions: who takes part in one, and what ends it."""

from endoscope_core.safety import MotionSession

MS = 1_000_000


def joined(name='session-2'):
    session = MotionSession()
    session.hear('', 0)
    session.beat(0)
    session.hear(name, 10 * MS)
    session.beat(10 * MS)
    return session


def test_who_hears_a_session_being_opened_takes_part():
    assert joined().name == 'session-2'
    assert joined().belongs('session-2')
    assert not joined().belongs('session-1')
    assert not joined().belongs('')


def test_who_starts_while_a_session_is_open_does_not():
    session = MotionSession()
    assert not session.hear('session-2', 0)
    assert session.name == ''
    assert 'was not there when session-2 was opened' in session.trouble
    assert not session.hear('session-2', 50 * MS)
    session.hear('', 100 * MS)
    assert session.trouble == ''
    assert session.hear('session-3', 150 * MS)


def test_a_session_that_was_left_is_not_entered_again():
    session = joined()
    session.leave('no handle')
    assert not session.hear('session-2', 50 * MS)
    assert session.name == ''
    assert 'no handle; give enable again' in session.trouble
    assert session.hear('session-3', 100 * MS)


def test_a_silent_supervisor_ends_it_within_a_fifth_of_a_second():
    session = joined()
    left = next(t for t in range(11, 1000) if not _beaten(session, t * MS).name)
    assert 150 <= left - 10 <= 200
    assert 'silent' in session.trouble


def _beaten(session, now):
    session.beat(now)
    return session


def test_what_a_late_loop_did_not_hear_is_no_silence():
    session = joined()
    for turn in range(1, 20):
        now = (10 + 90 * turn) * MS
        session.beat(now)
        assert session.name
        session.hear('session-2', now)


def test_a_slow_loop_that_hears_nothing_leaves_within_three_turns():
    session = joined()
    for turn in range(1, 4):
        session.beat((10 + 90 * turn) * MS)
    assert 'silent' in session.trouble


def test_a_loop_that_stood_still_leaves():
    session = joined()
    session.beat(111 * MS)
    assert session.name == ''
    assert 'stood still for 101 ms' in session.trouble


def test_a_heartbeat_that_may_be_somebody_elses_ends_it():
    session = joined()
    session.hear('session-2', 20 * MS, 'slave/motion_session has 2 senders')
    assert session.name == ''
    assert '2 senders' in session.trouble
    assert not session.hear('session-9', 30 * MS, 'slave/motion_session has 2 senders')
    assert not session.hear('session-2', 40 * MS)
    assert session.name == ''
    assert '2 senders' in session.trouble
    session.hear('', 50 * MS)
    assert session.trouble == ''
    assert session.hear('session-10', 60 * MS)
