import pytest

from endoscope_core.safety import ClutchFollower


def follower(scale=1.0):
    return ClutchFollower(scale, (-1.0, -1.0), (1.0, 1.0))


def test_engaging_does_not_move_the_slave():
    clutch = follower()
    clutch.engage((0.7, -0.2), (0.1, 0.3))
    assert clutch.follow((0.7, -0.2)) == (0.1, 0.3)


def test_follows_with_scale_and_re_references():
    clutch = follower(0.5)
    clutch.engage((0.0, 0.0), (0.0, 0.0))
    position = clutch.follow((0.4, -0.4))
    assert position == pytest.approx((0.2, -0.2))
    clutch.release()
    assert not clutch.engaged
    clutch.engage((-3.0, 3.0), position)
    assert clutch.follow((-3.0, 3.0)) == position
    assert clutch.follow((-2.8, 3.0)) == pytest.approx((0.3, -0.2))


def test_stays_within_limits():
    clutch = follower()
    clutch.engage((0.0, 0.0), (0.9, 0.0))
    assert clutch.follow((5.0, -5.0)) == (1.0, -1.0)


def test_does_not_follow_while_open():
    with pytest.raises(RuntimeError, match='not engaged'):
        follower().follow((0.0, 0.0))
