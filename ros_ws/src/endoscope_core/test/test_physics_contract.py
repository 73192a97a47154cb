"""What every effect of the catalogue owes the plant, whatever its physics."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from physics_rig import ACTING, hand, run

from endoscope_core import physics
from endoscope_core.physics import layout as L
from endoscope_core.physics.effect import Symptom
from endoscope_core.physics.effects import CATALOGUE, showing
from endoscope_core.physics.hooks import LINKS, ON_SAMPLES

TICKS, TICK = 5000, 1e-3
COMMAND = hand(TICKS, TICK, 0.7)
COMMAND[3000:3200] += 0.3
OTHER = 0.3 * np.cos(1.9 * TICK * np.arange(TICKS))
EARLY = {'time_s': 1.5, 'duration_s': 0.4, 'span_s': 5.0}
"""What happens at some time happens within the command, and takes a time."""
YIELDING = {'joint_stop', 'contact', 'gravity', 'joint_inertia'}
"""Moments that depend on the joint's own motion."""


def given(effect_id):
    """Parameters under which an effect shows within the command."""
    return {e.name: EARLY[e.name] for e in CATALOGUE[effect_id].parameters if e.name in EARLY}


def readings(done):
    """Motor, effort, tensions and bending angle (N, 5) in units of their sensors' noise."""
    noise = (1.5e-3, 1.5e-3, 0.02, 0.02, 4.4e-3)
    signals = (done.motor, done.effort, done.a, done.b, done.bending)
    return np.column_stack([s / n for s, n in zip(signals, noise, strict=True)])


@pytest.fixture(scope='module')
def nominal():
    return readings(run(COMMAND, other=OTHER))


@pytest.mark.parametrize('effect_id', ACTING)
def test_at_its_off_values_an_effect_is_the_nominal_plant_to_the_last_bit(effect_id, nominal):
    off = {e.name: e.off for e in CATALOGUE[effect_id].parameters if not math.isnan(e.off)}
    assert off
    here = run(COMMAND, {effect_id: given(effect_id) | off}, other=OTHER)
    np.testing.assert_array_equal(readings(here), nominal)


@pytest.mark.parametrize('effect_id', ACTING)
def test_a_typical_effect_shows_in_what_sensors_read(effect_id, nominal):
    here = run(COMMAND, {effect_id: given(effect_id)}, other=OTHER)
    assert np.abs(readings(here) - nominal).max() > 2.0


@pytest.mark.parametrize('effect_id', ACTING)
@pytest.mark.parametrize('tick', [5e-4, 1e-2])
def test_trajectories_are_finite_at_all_bounds(effect_id, tick):
    command = np.concatenate([hand(300, tick), np.zeros(50), np.full(50, -0.5)])
    for parameter in CATALOGUE[effect_id].parameters:
        for bound in (parameter.low, parameter.high):
            here = run(command, {effect_id: {parameter.name: bound}}, tick, other=0.4)
            assert np.isfinite(readings(here)).all(), (parameter.name, bound)
            if effect_id.startswith('load_cell'):
                continue
            assert min(here.a.min(), here.b.min()) >= 0.0, (parameter.name, bound)


def continuous():
    """Effects, parameters and a value strictly within its bounds at which to differentiate."""
    for effect_id in ACTING:
        for e in CATALOGUE[effect_id].parameters:
            if e.choices or e.counted:
                continue
            tries = (EARLY.get(e.name, e.typical), *e.starts, e.low + 0.1 * (e.high - e.low))
            value = next(v for v in tries if e.low < v < e.high and v < 1e6)
            yield pytest.param(effect_id, e, value, id=f'{effect_id}-{e.name}')


@pytest.mark.parametrize(('effect_id', 'parameter', 'value'), list(continuous()))
def test_derivatives_agree_at_two_step_sizes(effect_id, parameter, value):
    def slope(step):
        sides = []
        for v in (value - step, value + step):
            sides.append(
                run(COMMAND, {effect_id: given(effect_id) | {parameter.name: v}}, other=OTHER)
            )
        return (readings(sides[1]) - readings(sides[0])) / 2.0

    room = min(value - parameter.low, parameter.high - value)
    step = min(2e-3 * abs(value), 0.5 * room)
    wide, narrow = slope(step), 2.0 * slope(0.5 * step)
    size = np.linalg.norm(wide)
    if size < 1e-9:
        np.testing.assert_allclose(narrow, 0.0, atol=1e-9)
    else:
        # Fronts that meet, and gaps that are crossed, come at whole ticks.
        assert np.linalg.norm(wide - narrow) < 0.2 * size


@pytest.mark.parametrize('place', range(len(LINKS['load'])), ids=lambda i: LINKS['load'][i][0].id)
def test_slopes_of_moments_are_their_derivatives(place):
    effect, moment = LINKS['load'][place]
    draw = np.random.default_rng(place)
    worst = 0.0
    for _ in range(300):
        p, x = np.zeros(L.SLOTS.parameters), np.zeros(L.SLOTS.states)
        for index, e in zip(effect.places, effect.parameters, strict=True):
            p[index] = draw.uniform(e.low, min(e.high, 10.0 + e.low))
        start, step = draw.uniform(-1.5, 1.5), draw.normal(scale=1e-3)
        other, time, tick = draw.normal(), draw.uniform(0.0, 30.0), 10.0 ** draw.uniform(-3.3, -2)
        x[L.JOINT_STEP] = draw.normal(scale=1e-3)

        def at(step, p=p, x=x, start=start, rest=(other, time, tick)):
            return moment(p, x, start + step, step, *rest)

        value, slope = at(step)
        h = 1e-7
        difference = -(at(step + h)[0] - at(step - h)[0]) / (2.0 * h)
        assert difference == pytest.approx(slope, rel=1e-4, abs=1e-4 * (abs(value) + 1.0))
        worst = max(worst, abs(slope))
    assert (worst > 0.0) == (effect.id in YIELDING)


def test_an_effect_acts_on_the_rig_or_on_its_samples():
    linked = {effect.id for links in LINKS.values() for effect, _ in links}
    assert linked == set(ACTING)
    assert set(ON_SAMPLES) == {'clock_skew', 'recording_gap', 'tracker_outliers'}


def test_no_effect_is_named_outside_its_own_folder():
    ids = re.compile(r'\b(' + '|'.join(CATALOGUE) + r')\b')
    for path in Path(physics.__path__[0]).glob('*.py'):
        if path.name == 'family.py':
            # The recorded rig's tracker has a delay of the same name.
            continue
        assert not ids.findall(path.read_text(encoding='utf-8')), path.name
    for path in (Path(physics.__path__[0]) / 'effects').glob('*.py'):
        found = set(re.findall(r'effects\.(\w+) import|effects import (\w+)', path.read_text()))
        assert not {name for pair in found for name in pair} & set(CATALOGUE), path.name


@pytest.mark.parametrize('symptom', Symptom)
def test_a_symptom_is_of_one_effect(symptom):
    assert [e for e in CATALOGUE.values() if e.traits.symptom is symptom] == [showing(symptom)]
