"""A node's part in motion sessions."""

from endoscope_core.safety import MotionSession

MS = 1_000_000


def test_a_supervisor_that_comes_back_while_the_dead_one_still_counts_clears_the_trouble():
    session = MotionSession()
    session.hear('', 0)
    session.hear('session-1', 50 * MS)
    for t in range(50, 300, 10):
        session.beat(t * MS)
    assert 'silent' in session.trouble
    session.hear('', 310 * MS, doubt='slave/motion_session has 2 senders')
    assert 'silent' in session.trouble
    session.hear('', 360 * MS)
    assert not session.trouble
    assert session.hear('session-2', 410 * MS)
    assert session.name == 'session-2'


def test_a_session_first_heard_of_in_doubt_is_not_entered_and_that_is_said():
    session = MotionSession()
    session.hear('', 0)
    session.hear('session-1', 50 * MS, doubt='two senders')
    assert not session.hear('session-1', 100 * MS)
    assert not session.name
    assert 'two senders' in session.trouble
    session.hear('', 150 * MS)
    assert not session.trouble
