import math

import pytest

from endoscope_core.safety import TensionGuard


@pytest.mark.parametrize(
    ('readings', 'troubled'),
    [
        # Three in a row, one way and the other; a spike is not a tension.
        ([11.0, 11.0, 12.0], [False, False, True]),
        ([20.0, 20.0, 20.0, 9.0, 9.0, 9.0], [False, False, True, True, True, False]),
        ([1.0, 50.0, 50.0] * 9, [False] * 27),
        ([10.5] * 3 + [9.5] * 18, [False, False] + [True] * 19),
        ([math.nan] * 3, [False, False, True]),
    ],
)
def test_three_readings_in_a_row_make_trouble_and_end_it(readings, troubled):
    guard = TensionGuard(('a', 'b'), 10.0)
    told = [guard.update((5.0, reading)) for reading in readings]
    assert [bool(trouble) for trouble in told] == troubled
    assert all('b' in trouble for trouble in told if trouble)
    if max(readings) == 12.0:
        assert '12.0 N' in told[-1]
        assert guard.peak == 12.0
    if math.isnan(readings[0]):
        assert 'nan' in told[-1]
