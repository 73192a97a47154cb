import numpy as np
import pytest

from endoscope_core.safety import BumplessOutput

DT = 1e-3


def run(blend, sources):
    return np.array([blend.step(raw, DT) for raw in sources])


def test_follows_exactly_without_changes():
    raw = [(0.1 * k, -0.1 * k) for k in range(50)]
    np.testing.assert_array_equal(run(BumplessOutput(2, 0.5, 1.0), raw), raw)


@pytest.mark.parametrize('gap', [0.01, 0.3, 1.5])
def test_a_change_neither_jumps_nor_hurries_and_ends_at_the_new_source(gap):
    blend = BumplessOutput(1, 0.5, 1.0)
    before = run(blend, [(0.2,)] * 10)
    blend.change()
    after = run(blend, [(0.2 + gap,)] * 4000)
    path = np.concatenate([before[-1:], after])[:, 0]
    speed = np.abs(np.diff(path)) / DT
    assert speed.max() <= 1.0 + 1e-6
    acceleration = np.abs(np.diff(path, 2)) / DT**2
    assert acceleration.max() < 25.0
    assert path[-1] == 0.2 + gap
    assert blend.settled


def test_a_change_in_the_middle_of_a_fade_is_continuous():
    blend = BumplessOutput(1, 0.5, 1.0)
    run(blend, [(0.0,)] * 5)
    blend.change()
    first = run(blend, [(0.5,)] * 200)
    blend.change()
    second = run(blend, [(-0.5,)] * 4000)
    path = np.concatenate([first, second])[:, 0]
    assert np.abs(np.diff(path)).max() / DT <= 1.0 + 1e-6
    assert path[-1] == -0.5


def test_may_start_where_the_motor_is():
    blend = BumplessOutput(2, 0.5, 1.0)
    blend.change((0.3, -0.3))
    assert blend.step((0.0, 0.0), DT) == (0.3, -0.3)
