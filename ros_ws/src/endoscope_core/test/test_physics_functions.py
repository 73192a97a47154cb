"""Smooth functions of one state at the places of the chain, in the simulated plant."""

import math
from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.physics import EffectSpec, JointParameters, PlantDescription, TermSpec, simulate
from endoscope_core.physics.folds import folded
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.evaluation import function_at
from endoscope_core.physics.functions.places import NODES, VALUES, Shape
from endoscope_core.physics.functions.term import tabulated
from endoscope_core.physics.hooks import LOAD
from endoscope_core.physics.packing import pack, rest_state

TICK = 1e-3
SECONDS = 5.0
NOISE = (1.5e-3, 1.5e-3, 0.02, 0.02, 4.4e-3)
"""Of motor, effort, tensions and bending angle."""
ANY = (0.0, 1.0)
"""Share and side of a function that is taken as it is."""


def command(tick=TICK):
    """Both shafts (N, 2), rad: motions with reversals, one of them far slower."""
    time = tick * np.arange(round(SECONDS / tick))
    x = 0.5 * np.sin(2.3 * time) + 0.3 * np.sin(5.1 * time)
    return np.stack([x, 0.4 * np.sin(1.3 * time)], axis=1)


def readings(*added, tick=TICK, start=(0.0, 0.0)):
    """What the sensors of the first joint read (N, 5), in units of their noise."""
    plant = PlantDescription(
        effects=tuple(each for each in added if isinstance(each, EffectSpec)),
        terms=tuple(each for each in added if isinstance(each, TermSpec)),
    )
    done = simulate(plant, command(tick) + start, tick, start_shaft=start)
    signals = [done.shaft_position, done.shaft_effort, *done.tension.T.swapaxes(1, 2)]
    columns = np.stack([*(s[:, 0] for s in (*signals[:2], *signals[2:], done.bending))], axis=1)
    return columns / NOISE


@pytest.fixture(scope='module')
def nominal():
    return readings()


REACHED = {
    'v': (0.0, 0.005), 'd': (0.0, 0.03), 't': (0.0, SECONDS), 's': (-0.003, 0.003),
    'e': (-0.2, 0.2), 'w': (-5.0, 5.0), 'D': (-10.0, 10.0), 'T': (0.0, 12.0),
    'F': (-5.0, 5.0), 'y': (0.0, 0.005), 'z': (-0.5, 0.5),
}  # fmt: skip
"""Of each symbol, what the command visits."""
SIZE = {'N s/m': 200.0, 'm': 3e-4, 'N m': 2e-4, 'N': 0.5, 'rad': 0.05, '-': 0.3}
"""Of a function that shows and is no catastrophe, by its unit."""
OWN_SIZE = {'effort_of_speed': 5e-3, 'load_of_speed': -2e-4, 'load_of_speed_size': -1.5e-5}
"""And by its place: a moment along the joint's speed would drive it on."""


def shown(place_id, size=1.0):
    """A term that shows within the command, with a shape that the place takes."""
    place = FUNCTIONS[place_id]
    low, high = REACHED.get(place.argument.symbol, (-1.0, 1.0))
    if place.shape is Shape.PERIODIC:
        low, high = 0.0, 0.5 * (high - low)
    across = f'({place.argument.symbol} - {low}) / {high - low}'
    law = {
        Shape.ANY: f'sin(1.5 * {across}) ** 2',
        Shape.ODD: f'tanh({place.argument.symbol} / {high / 3.0})',
        Shape.EVEN: f'1 - cos({place.argument.symbol} / {high / 3.0})',
        Shape.PERIODIC: f'sin(2 * pi * {across})',
    }[place.shape]
    return TermSpec(
        'bend_x',
        place_id,
        f'{size * OWN_SIZE.get(place_id, SIZE[place.unit])} * ({law})',
        range=(low, high),
    )


def zero(place_id):
    return TermSpec('bend_x', place_id, values=(0.0,) * NODES)


@pytest.mark.parametrize('place_id', FUNCTIONS)
def test_a_function_that_is_zero_is_the_nominal_plant_to_the_last_bit(place_id, nominal):
    np.testing.assert_array_equal(readings(zero(place_id)), nominal)


@pytest.mark.parametrize('place_id', FUNCTIONS)
def test_a_function_shows_in_what_sensors_read(place_id, nominal):
    here = readings(shown(place_id))
    assert np.isfinite(here).all()
    assert np.abs(here - nominal).max() > 0.5


@pytest.mark.parametrize('place_id', FUNCTIONS)
def test_derivatives_agree_at_two_step_sizes(place_id):
    def slope(step):
        return (
            readings(shown(place_id, 1.0 + step)) - readings(shown(place_id, 1.0 - step))
        ) / step

    wide, narrow = slope(4e-3), slope(2e-3)
    # Fronts that meet come at whole ticks.
    assert np.linalg.norm(wide - narrow) < 0.2 * np.linalg.norm(wide)


@pytest.mark.parametrize('place_id', FUNCTIONS)
def test_ticks_agree_as_those_of_the_nominal_plant_do(place_id, nominal):
    fine, few = readings(shown(place_id))[::10], nominal[::10]
    for tick in (2e-3, 5e-3):
        every = round(1e-2 / tick)
        left = np.abs(readings(shown(place_id), tick=tick)[::every] - fine).max(axis=0)
        bare = np.abs(readings(tick=tick)[::every] - few).max(axis=0)
        assert np.all(left < 2.0 * bare + 0.3), (tick, left, bare)


PRODUCTS = [
    ('load_of_speed', 'load_of_angle'),
    ('load_of_angle', 'load_of_time'),
    ('exponent_of_speed', 'exponent_of_angle'),
    ('stiffness_of_tension', 'stiffness_of_time'),
    ('length_difference_of_time', 'length_of_angle'),
    ('pulley_of_shaft', 'pulley_of_tension'),
    ('load_cell_pos_of_tension', 'load_cell_pos_of_time'),
]


@pytest.mark.parametrize(('place_id', 'other'), PRODUCTS)
def test_a_function_that_multiplies_scales_what_the_others_add(place_id, other):
    nothing = TermSpec('bend_x', other, values=(0.0,) * NODES, multiplies=True)
    same = readings(shown(place_id))
    np.testing.assert_array_equal(readings(shown(place_id), nothing), same)
    if FUNCTIONS[other].from_zero:
        return
    more = TermSpec('bend_x', other, values=(0.5,) * NODES, multiplies=True)
    scaled = readings(shown(place_id, 1.5))
    np.testing.assert_allclose(readings(shown(place_id), more), scaled, rtol=1e-9, atol=1e-6)


def test_the_slope_of_a_product_is_what_it_changes_by_the_step():
    law, factor = shown('load_of_speed'), shown('load_of_angle')
    factor = TermSpec('bend_x', factor.place, '0.5*sin(2*q)', range=(-1.5, 1.5), multiplies=True)
    parameters, flags = pack(PlantDescription(terms=(law, factor)))
    states, _, _ = rest_state(parameters, flags, TICK)
    moment = folded(LOAD)

    def load(step):
        return moment(flags[0], parameters[0], states[0], 0.3 + step, step, 0.0, 1.0, TICK)

    step, little = 1e-3, 1e-7
    slope = (load(step + little)[0] - load(step - little)[0]) / (2.0 * little)
    assert load(step)[1] == pytest.approx(-slope, rel=1e-5)
    assert abs(slope) > 1e-6


SAME = {
    'viscous_friction': ({'coefficient': 0.0, 'load_factor': 60.0}, 'exponent_of_speed',
                         'log(1 + 60 * v / 0.9)', (0.0, 0.01)),
    'stribeck_friction': ({'rise': 0.5, 'stribeck_speed': 1e-3}, 'exponent_of_speed',
                          'log(1 + 0.5 * exp(-v / 1e-3))', (0.0, 0.008)),
    'friction_run_in': ({'excess': 0.5, 'distance_m': 0.01}, 'exponent_of_distance',
                        'log(1 + 0.5 * exp(-d / 0.01))', (0.0, 0.05)),
    'pretension_loss': ({'rate_n_per_s': 0.1, 'span_s': 5.0}, 'length_of_time', None, (0.0, 5.0)),
    'wire_geometry': ({'asymmetry': 0.1}, 'travel_of_travel', '-0.1 * s**2 / 0.0024',
                      (-0.004, 0.004)),
    'cogging': ({'amplitude_rad': 0.03, 'cycles_per_turn': 12.0, 'phase_rad': 0.4},
                'pulley_periodic', '0.03 * sin(12 * m + 0.4)', (0.0, math.pi / 6.0)),
    'gear_friction': ({'torque_nm': 0.005, 'speed_rad_per_s': 0.3, 'viscous': 1e-3},
                      'effort_of_speed', '0.005 * tanh(w / 0.3) + 1e-3 * w', (-4.0, 4.0)),
    'gravity': ({'moment_nm': 0.001, 'phase_rad': 0.3}, 'load_of_angle', '-0.001 * sin(q + 0.3)',
                (-1.5, 1.5)),
    'breathing': ({'moment_nm': 6e-4, 'frequency_hz': 0.5, 'phase_rad': 0.4,
                   'second_harmonic': 0.2}, 'load_periodic',
                  '6e-4 * (sin(pi * t + 0.4) + 0.2 * cos(2 * (pi * t + 0.4)))', (0.0, 2.0)),
    'cross_coupling': ({'moment_per_rad': 0.0015, 'moment_per_rad2': -0.001}, 'load_of_other_angle',
                       '0.0015 * q_other - 0.001 * q_other**2', None),
    'load_cell_gain': ({'gain': 1.15, 'wire': 1.0}, 'load_cell_neg_of_tension', '0.15 * T', None),
    'load_cell_bias': ({'bias_n': 0.3, 'wire': 1.0}, 'load_cell_neg_of_tension', '0.3', None),
    'load_cell_crosstalk': ({'share': 0.1}, 'load_cell_pos_of_other_wire', '0.1 * T', None),
    'load_cell_drift': ({'rate_n_per_s': 0.05}, 'load_cell_pos_of_time', '0.05 * t', None),
    'tracker_distortion': ({'quadratic': 0.1, 'cubic': -0.2}, 'tracker_of_angle',
                           '0.1 * q**2 - 0.2 * q**3', (-1.5, 1.5)),
    'tracker_drift': ({'rate_rad_per_s': 0.01}, 'tracker_of_time', '0.01 * t', None),
}  # fmt: skip
"""Of effects of the catalogue: parameters, and the same law as a function."""


@pytest.mark.parametrize('effect_id', SAME)
def test_a_law_of_the_catalogue_as_a_function_does_the_same(effect_id, nominal):
    parameters, place_id, law, reach = SAME[effect_id]
    effect = readings(EffectSpec(effect_id, 'bend_x', parameters))
    term = TermSpec('bend_x', place_id, law or '', range=reach)
    if law is None:
        # It grows at 0.1 N/s as far as a measured stretch at rest: from what the effect does.
        rest = readings(TermSpec('bend_x', place_id, '2e-5 * t', range=reach)) - nominal
        share = np.vdot(rest, effect - nominal) / np.vdot(rest, rest)
        term = TermSpec('bend_x', place_id, f'{share * 2e-5} * t', range=reach)
    here = readings(term)
    size = np.abs(effect - nominal).max()
    assert size > 2.0
    assert np.abs(here - effect).max() < 0.02 * size


def test_creep_is_a_function_of_the_lagging_tension(nominal):
    ratio, lag = 0.05, 0.8
    creep = {'compliance_ratio': ratio, 'time_constant_s': lag}
    effect = readings(EffectSpec('wire_creep', 'bend_x', creep)) - nominal
    stiffness = JointParameters().wire_stiffness
    law = f'{ratio / stiffness} * F'
    where = 'length_of_lagging_tension'
    here = readings(TermSpec('bend_x', where, law, range=(-15.0, 15.0), lag_s=lag)) - nominal
    size = np.abs(effect).max()
    assert size > 2.0
    # The wire unloads as it creeps, which makes it quicker by the ratio.
    assert np.abs(here - effect).max() < 1.5 * ratio * size


def test_what_lags_follows_the_faster_the_shorter_its_time_is():
    def late(lag):
        law = TermSpec('bend_x', 'load_of_relaxing_angle', '-0.002 * z', range=(-1.5, 1.5))
        return readings(replace(law, lag_s=lag))[:, -1]

    nothing, stiffer = (
        readings()[:, -1],
        readings(TermSpec('bend_x', 'load_of_angle', '-0.002 * q', range=(-1.5, 1.5)))[:, -1],
    )
    moved = np.abs(stiffer - nothing).max()
    assert np.abs(late(0.05) - nothing).max() < 0.5 * moved
    assert np.abs(late(60.0) - stiffer).max() < 0.2 * moved


def table(law, low=0.0, high=1.0):
    return np.array([low, high, *law(np.linspace(low, high, NODES))])


def values(numbers, arguments, share_side=ANY, *, repeats=False):
    return np.array([function_at(numbers, 0, each, *share_side, repeats) for each in arguments]).T


def triangle(place):
    return lambda u: 2.0 * np.abs(2.0 * ((u - place) % 1.0) - 1.0) - 1.0


@pytest.mark.parametrize(
    'laws',
    [
        [lambda u, c=c: np.tanh((u - c) / 0.1) for c in np.linspace(0.0, 1.0, 33)],
        [lambda u: np.exp(-u / 0.1), lambda u: np.exp(-u / 0.05)],
        [lambda u: (u - 0.3) ** 2],
        [triangle(place) for place in np.linspace(0.0, 1.0, 33)],
    ],
    ids=['tanh', 'decay', 'parabola', 'triangle wave'],
)
def test_tables_lose_less_than_2_percent_of_common_laws(laws):
    fine = np.linspace(0.0, 1.0, 4001)
    for law in laws:
        found, _ = values(table(law), fine)
        assert np.abs(found - law(fine)).max() < 0.02 * np.ptp(law(fine))


def test_a_function_goes_through_its_values_and_keeps_the_last_ones():
    numbers = np.array([-1.0, 3.0, *np.random.default_rng(1).normal(size=NODES)])
    found, slopes = values(numbers, np.linspace(-1.0, 3.0, NODES))
    np.testing.assert_allclose(found, numbers[VALUES:], atol=1e-12)
    beyond, flat = values(numbers, (-50.0, -1.0, 3.0, 1e300, math.nan))
    ends = numbers[[VALUES, VALUES, -1, -1, VALUES]]
    np.testing.assert_allclose(beyond, ends, atol=1e-12)
    assert not flat.any()
    assert slopes[1:-1].any()


@pytest.mark.parametrize('repeats', [False, True])
@pytest.mark.parametrize('share_side', [ANY, (-0.5, -1.0), (0.5, -1.0), (-1.0, 0.0)])
def test_slopes_are_derivatives_and_have_no_corners(share_side, repeats):
    numbers = np.array([-1.0, 1.0, *np.random.default_rng(2).normal(size=NODES)])
    at = np.linspace(-0.97, 0.97, 991)
    _, slope = values(numbers, at, share_side, repeats=repeats)
    (above, _), (below, _) = (
        values(numbers, at + h, share_side, repeats=repeats) for h in (1e-6, -1e-6)
    )
    np.testing.assert_allclose((above - below) / 2e-6, slope, atol=1e-3)
    mirrored, _ = values(numbers, -at, share_side, repeats=repeats)
    if share_side[0] and share_side[1]:
        own, _ = values(numbers, at, share_side, repeats=repeats)
        np.testing.assert_allclose(mirrored, np.sign(share_side[0]) * own, atol=1e-12)


def test_a_periodic_function_begins_again_without_a_step_or_a_corner():
    numbers = table(lambda u: np.sin(2.0 * np.pi * u))
    at = np.linspace(-2.5, 2.5, 501)
    found, slopes = values(numbers, at, repeats=True)
    np.testing.assert_allclose(found, np.sin(2.0 * np.pi * at), atol=1e-3)
    np.testing.assert_allclose(slopes, 2.0 * np.pi * np.cos(2.0 * np.pi * at), atol=0.05)


def test_a_table_says_what_it_loses():
    kink = tabulated(TermSpec('bend_x', 'load_of_angle', '0.01 * abs(q - 0.033)', range=(-1, 1)))
    smooth = tabulated(TermSpec('bend_x', 'load_of_angle', '0.01 * sin(q)', range=(-1, 1)))
    assert smooth.largest_error < 1e-4 < 2e-3 < kink.largest_error < 0.02
