"""Losses found in publication numbers."""

from hypothesis import given
from hypothesis import strategies as st

from endoscope_bags.sequence_gaps import SequenceGaps


def lost(sequences, publishers=1):
    gaps = SequenceGaps()
    for sequence in sequences:
        gaps.add(sequence, lambda: publishers)
    assert gaps.received == len(sequences)
    return gaps.lost


def test_a_reader_that_comes_late_has_lost_nothing():
    assert lost([500, 501, 502]) == 0


def test_a_restarted_publisher_has_lost_nothing():
    assert lost([7, 8, 9, 1, 2, 3]) == 0


@given(st.integers(1, 10**6), st.sets(st.integers(1, 98)))
def test_every_message_missing_between_first_and_last_is_counted(first, dropped):
    sequences = [first + k for k in range(100) if k not in dropped]
    assert lost(sequences) == len(dropped)


@given(
    st.lists(st.booleans(), min_size=40, max_size=40), st.integers(1, 10**6), st.integers(1, 10**6)
)
def test_two_publishers_in_any_order_lose_nothing(order, first_a, first_b):
    next_number = {False: first_a, True: first_b}
    sequences = []
    for publisher in order:
        sequences.append(next_number[publisher])
        next_number[publisher] += 1
    assert lost(sequences, publishers=2) == 0


@given(st.sets(st.integers(2, 49)), st.sets(st.integers(2, 49)))
def test_the_losses_of_two_publishers_add_up(dropped_a, dropped_b):
    a = [(k, 100 + k) for k in range(1, 51) if k not in dropped_a]
    b = [(k + 0.5, 5000 + k) for k in range(1, 51) if k not in dropped_b]
    sequences = [number for _, number in sorted(a + b)]
    assert lost(sequences, publishers=2) == len(dropped_a) + len(dropped_b)


@given(st.lists(st.integers(2, 58), min_size=1, max_size=5, unique=True))
def test_numbers_that_come_late_are_not_lost(early):
    sequences = list(range(1, 60))
    for number in early:
        sequences.remove(number)
        sequences.insert(max(number - 5, 1), number)
    assert lost(sequences) == 0
