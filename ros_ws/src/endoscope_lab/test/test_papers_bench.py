import pytest

from endoscope_lab.papers.row import Figure


@pytest.mark.parametrize(
    ('values', 'aims', 'reached'),
    [
        ((1.0, 3.0), {}, None),
        ((1.0, 3.0), {'at_least': 2.0}, True),
        ((1.0, 3.0), {'at_least': 2.1}, False),
        ((1.0, 3.0), {'at_least': 1.0, 'at_most': 1.9}, False),
        ((1.0, float('nan')), {'at_most': 9.0}, False),
    ],
)
def test_the_mean_is_what_is_judged(values, aims, reached):
    assert Figure('x', values, **aims).reached is reached
