"""What a page's plots hold: no reading lies outside of what is drawn."""

import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from endoscope_pages.plots import (
    MOST_BINS,
    MOST_READINGS,
    Curve,
    Plot,
    banded,
    decimated,
    figure_html,
)

RNG = np.random.default_rng(1)
LONG = 1e-3 * np.arange(50_000)


def data_of(page):
    (text,) = re.findall(r'class="plot-data">(.*?)</script>', page, flags=re.DOTALL)
    return json.loads(text)


@given(st.integers(MOST_BINS + 2, 5 * MOST_BINS), st.integers(0, 2**32 - 1))
def test_every_reading_lies_in_its_band(count, seed):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.5, 1.5, count))
    values = rng.standard_normal(count)
    values[rng.integers(0, count, 20)] = np.nan
    edges, low, high = banded(time, values)
    assert len(low) == len(high) == len(edges) - 1 <= MOST_BINS
    assert (edges[0], edges[-1]) == (time[0], time[-1])
    place = np.clip(np.searchsorted(edges, time, side='right') - 1, 0, len(low) - 1)
    known = np.isfinite(values)
    assert np.all(low[place][known] <= values[known])
    assert np.all(values[known] <= high[place][known])


def test_bands_of_neighbours_touch():
    """So that a steep line is not drawn as loose dashes."""
    _, low, high = banded(LONG, LONG**3)
    assert np.all(low[1:] <= high[:-1])


def test_a_stretch_without_readings_is_a_gap():
    values = np.ones_like(LONG)
    values[10_000:20_000] = np.nan
    _, low, high = banded(LONG, values)
    assert np.isnan(low[500:700]).all()
    assert np.nanmin(low) == np.nanmax(high) == 1.0


def test_a_loop_keeps_its_extremes_and_its_order():
    x, y = np.sin(LONG), np.cos(LONG) + 0.01 * RNG.standard_normal(len(LONG))
    kept = decimated(x, y)
    assert len(kept) <= MOST_READINGS
    assert np.all(np.diff(kept) > 0)
    for values in (x, y):
        assert values[kept].min() == values.min()
        assert values[kept].max() == values.max()


def test_short_curves_are_drawn_reading_by_reading_and_long_ones_as_bands():
    few, many = LONG[:MOST_READINGS], LONG
    curves = (Curve('few', few, np.sin(few)), Curve('many', many, np.sin(many)))
    data = data_of(figure_html([Plot('both', 'time (s)', curves)]))
    drawn_few, drawn_many = data['plots'][0]['curves']
    assert drawn_few['y'] == pytest.approx(np.sin(few), abs=2e-5)
    assert 'y' not in drawn_many
    assert len(data['x'][drawn_many['x']]) == len(drawn_many['low']) + 1


def test_positions_that_curves_share_are_in_the_page_once():
    curves = tuple(Curve(name, LONG[:100], LONG[:100] + k) for k, name in enumerate('abc'))
    data = data_of(figure_html([Plot('plot', 'time (s)', curves)] * 2))
    assert len(data['x']) == 1


def test_gaps_are_null_and_the_range_is_of_what_is_known():
    curve = Curve('a', LONG[:4], np.array([1.0, np.nan, 3.0, np.inf]))
    (plot,) = data_of(figure_html([Plot('plot', 'time (s)', (curve,))]))['plots']
    assert plot['curves'][0]['y'] == [1.0, None, 3.0, None]
    assert 0.8 < plot['range_y'][0] < 1.0
    assert 3.0 < plot['range_y'][1] < 3.2


def test_no_label_ends_the_page_early():
    name = '</script><b>&'
    page = figure_html([Plot(name, name, (Curve(name, LONG[:3], LONG[:3]),))], name)
    assert '<b>' not in page
    assert page.count('</script>') == 1
    assert data_of(page)['plots'][0]['x_label'] == name


def test_the_table_has_the_numbers_of_every_curve():
    curve = Curve('a', LONG[:4], np.array([1.0, np.nan, 3.0, -2.0]))
    table = figure_html([Plot('plot', 'time (s)', (curve,))])
    cells = re.findall(r'<td>(.*?)</td>', table)
    assert cells == ['3', '-2', '3', '0.6667', '2.16']


@pytest.mark.parametrize(
    ('make', 'named'),
    [
        (lambda: Curve('a', LONG[:3], LONG[:5]), "'a' has 5 values at 3 places"),
        (lambda: Curve('a', LONG[:0], LONG[:0]), "'a' has 0 values"),
        (lambda: Curve('a', LONG[:3], LONG[:3], low=LONG[:2]), "'a': low has 2, not 3"),
        (
            lambda: Plot('p', 'x', (Curve('a', LONG[:3], LONG[:3]),), loop=True),
            "'a' of a loop needs the time",
        ),
    ],
)
def test_curves_that_cannot_be_drawn_are_named(make, named):
    with pytest.raises(ValueError, match=named):
        make()
