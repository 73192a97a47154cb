"""One fit of two recordings of a rig: the same device, nearly the same joint, another tube."""

import math
from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.layout import JOINT_RADIUS
from endoscope_explain.fit.intervals import covariance
from endoscope_explain.fit.model import fit
from endoscope_explain.fit.nominal import with_references
from endoscope_explain.fit.pooled import (
    SPREAD,
    deviations,
    fit_together,
    judged_alone,
    with_common_numbers,
)
from endoscope_explain.observe.observation import observe
from endoscope_explain.search.term import with_effect

GAIN = 0.9
STIFFNESS = 0.005
TUBES = (0.7, 1.1)


def place(found, name):
    return next(k for k, item in enumerate(found.model.free) if item.name == name)


def value(found, name):
    k = place(found, name)
    return found.model.free[k].value(float(found.theta[k]))


@pytest.fixture(scope='module')
def separate(one_joint):
    """The second tube moves so little that it knows little of its joint's stiffness."""
    fits = []
    for exponent, size in zip(TUBES, (1.0, 0.45), strict=True):
        rig = one_joint.rig(
            EffectSpec('load_cell_gain', 'bend_x', {'gain': GAIN, 'wire': 1.0}),
            capstan_exponent=exponent,
            joint_stiffness=STIFFNESS,
        )
        recording = one_joint.record(rig, size * one_joint.motion(3.0))
        plant = one_joint.rig()
        _, ((nominal, _),) = with_references(recording, observe(recording, plant), plant, 0.5, 1)
        model = with_effect(nominal.model, CATALOGUE['load_cell_gain'], {'gain': 0.95, 'wire': 1.0})
        fits.append(fit(model, model.begun_at(nominal.theta), iterations=20))
    return fits


@pytest.fixture(scope='module')
def together(separate):
    return fit_together([f.model for f in separate], [f.theta for f in separate])


def test_a_device_is_one_number_and_a_tube_is_not(together):
    first, second = together
    assert value(first, 'gain') == value(second, 'gain') == pytest.approx(GAIN, abs=0.002)
    assert value(first, 'motor_bandwidth') == value(second, 'motor_bandwidth')
    for found, exponent in zip(together, TUBES, strict=True):
        assert value(found, 'capstan_exponent') == pytest.approx(exponent, rel=0.03)


def test_a_channel_counts_by_what_is_left_of_it(together):
    """A noise that is described too small is no reason to follow that sensor alone."""

    def understated(model):
        channels = model.observation.channels
        cells = [
            c if c.quantity != 'tension' else replace(c, noise=0.1 * c.noise) for c in channels
        ]
        return replace(model, observation=replace(model.observation, channels=tuple(cells)))

    models = [understated(f.model) for f in together]
    again = fit_together(models, [f.theta for f in together])
    for before, after in zip(together, again, strict=True):
        for name in ('joint_stiffness', 'wire_stiffness', 'pretension'):
            assert value(after, name) == pytest.approx(value(before, name), rel=2e-3)


def test_what_is_shared_is_known_better_than_by_one_recording(together):
    for found, deviation in zip(together, deviations(together), strict=True):
        alone = np.sqrt(np.diag(covariance(found)))
        gain, exponent = place(found, 'gain'), place(found, 'capstan_exponent')
        assert deviation[gain] < alone[gain]
        assert deviation[exponent] < 1.01 * alone[exponent]
    first, second = deviations(together)
    assert first[gain] == second[gain]


def test_radii_are_one_number(separate):
    models, starts = [], []
    for found in separate:
        like = found.model.free[place(found, 'joint_stiffness')]
        radius = replace(
            like, index=JOINT_RADIUS, name='joint_radius', low=5e-4, high=1e-3, mean=math.log(8e-4)
        )
        models.append(replace(found.model, free=(*found.model.free, radius)))
        starts.append(np.append(found.theta, radius.mean))
    first, second = fit_together(models, starts)
    assert value(first, 'joint_radius') == value(second, 'joint_radius')


def test_a_recording_that_knows_little_of_its_joint_learns_from_the_other_one(separate, together):
    alone, pooled = (
        abs(math.log(value(f[1], 'joint_stiffness') / STIFFNESS)) for f in (separate, together)
    )
    assert pooled < 0.5 * alone
    stiffnesses = [value(f, 'joint_stiffness') for f in together]
    assert stiffnesses[0] != stiffnesses[1]


def test_common_numbers_are_those_of_joint_and_wires(together):
    common = with_common_numbers(together)
    for name, shared in (
        ('joint_stiffness', True),
        ('pretension', True),
        ('capstan_exponent', False),
    ):
        k = place(together[0], name)
        own = [f.theta[k] for f in together]
        expected = [np.median(own)] * 2 if shared else own
        assert [theta[k] for theta in common] == pytest.approx(expected)


def test_a_fit_goes_on_alone_with_the_device_held_and_the_joint_drawn_to_the_others(together):
    for found, alone in zip(together, judged_alone(together), strict=True):
        names = {item.name for item in alone.model.free}
        assert not names & {'gain', 'motor_bandwidth', 'motor_damping_ratio'}
        gain = CATALOGUE['load_cell_gain'].first_parameter
        assert alone.model.base[gain] == value(found, 'gain')
        assert alone.model.residuals(alone.theta) == pytest.approx(found.residuals, abs=1e-9)
        joint = alone.model.free[place(alone, 'joint_stiffness')]
        own = found.model.free[place(found, 'joint_stiffness')]
        assert joint.spread == pytest.approx((SPREAD**-2 + own.spread**-2) ** -0.5)
        tube = place(alone, 'capstan_exponent')
        assert alone.model.free[tube] == found.model.free[place(found, 'capstan_exponent')]
