import math

from endoscope_core.safety import TensionGuard

NAMES = ('a', 'b')


def test_names_the_wire_after_three_readings_in_a_row():
    guard = TensionGuard(NAMES, 10.0)
    assert guard.update((5.0, 11.0)) == ''
    assert guard.update((5.0, 11.0)) == ''
    trouble = guard.update((5.0, 12.0))
    assert 'b' in trouble
    assert '12.0 N' in trouble
    assert guard.peak == 12.0


def test_a_spike_is_not_a_tension():
    guard = TensionGuard(NAMES, 10.0)
    for k in range(100):
        assert guard.update((50.0 if k % 3 else 1.0, 1.0)) == ''


def test_not_a_number_is_trouble():
    guard = TensionGuard(NAMES, 10.0)
    for _ in range(2):
        assert guard.update((math.nan, 1.0)) == ''
    assert 'nan' in guard.update((math.nan, 1.0))


def test_trouble_ends_when_tensions_are_back():
    guard = TensionGuard(NAMES, 10.0)
    for _ in range(3):
        guard.update((20.0, 0.0))
    assert guard.update((9.0, 0.0))
    assert guard.update((9.0, 0.0))
    assert guard.update((9.0, 0.0)) == ''


def test_a_tension_that_stays_about_the_ceiling_stays_trouble():
    guard = TensionGuard(NAMES, 10.0)
    for _ in range(3):
        guard.update((10.5, 0.0))
    for k in range(30):
        assert guard.update((9.9 + 0.2 * (k % 2), 0.0))
