import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from endoscope_console.pictures import Envelope

SAMPLES = st.lists(st.floats(-1e6, 1e6) | st.just(math.nan), max_size=5)


@given(st.lists(st.tuples(st.integers(0, 2), SAMPLES), max_size=20))
def test_it_is_smallest_largest_and_last_of_what_came(takes):
    envelope = Envelope(3)
    came = [[], [], []]
    for k, values in takes:
        envelope.take(k, values)
        came[k] += [value for value in values if not math.isnan(value)]
    expected = [[min(c), max(c), c[-1]] if c else [math.nan] * 3 for c in came]
    np.testing.assert_array_equal(envelope.close(), expected)


def test_each_interval_begins_anew():
    envelope = Envelope(1)
    envelope.take(0, [1.0, -2.0])
    first = envelope.close()
    envelope.take(0, [0.5])
    np.testing.assert_array_equal(envelope.close(), [[0.5, 0.5, 0.5]])
    np.testing.assert_array_equal(first, [[-2.0, 1.0, -2.0]])
