"""Two effects that the screen sees together, and a signal that a name makes worse."""

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.fit.evidence import (
    counts,
    log_likelihood,
    mean_squares,
    predicts_worse,
)
from endoscope_explain.fit.model import packed_joint
from endoscope_explain.fit.nominal import nominal_references
from endoscope_explain.observe.observation import observe
from endoscope_explain.search.expansion import Parent, Screened
from endoscope_explain.search.pairs import better_pair, ranked_pairs
from endoscope_explain.search.refit import candidate, refit, trial_fit
from endoscope_explain.search.screen import background, directions
from endoscope_explain.search.term import Term, starting_points

NAMES = ('gravity', 'joint_backlash', 'load_cell_gain', 'viscous_friction', 'load_cell_bias')


@pytest.fixture(scope='module')
def two_missing(one_joint):
    """The refitted plant of a rig with two effects, and the screen of five."""
    plant = one_joint.rig()
    missing = [
        EffectSpec('gravity', 'bend_x', {'moment_nm': 0.002}),
        EffectSpec('load_cell_gain', 'bend_x', {'gain': 1.15, 'wire': 1}),
    ]
    (seen,) = observe(one_joint.record(one_joint.rig(*missing), one_joint.motion(7.0)), plant)
    refitted, _ = nominal_references(seen, *packed_joint(plant, 'bend_x'))
    nominal = candidate((), refitted)
    behind = background(refitted)
    terms = tuple(Term(CATALOGUE[n], s) for n in NAMES for s in starting_points(CATALOGUE[n]))
    ways = directions(behind, terms, 1)
    return Screened(Parent(nominal, ((refitted,),)), (behind,), (ways,), {})


def test_the_pair_that_is_missing_gains_most_together(two_missing):
    (first, *_) = ranked_pairs(two_missing.behind[0], two_missing.ways[0])
    assert {term.id for term in first.terms} == {'gravity', 'load_cell_gain'}


def test_what_two_gain_is_what_least_squares_leave(two_missing):
    behind, ways = two_missing.behind[0], two_missing.ways[0]
    observation = behind.fit.model.observation
    pairs = ranked_pairs(behind, ways)
    pair = next(p for p in pairs if all(t.is_linear and not t.is_function for t in p.terms))
    starts = [(t.variant, {k: abs(v) for k, v in t.start.items()}) for t in pair.terms]
    own = [w for s in starts for w in ways if (w.term.variant, w.term.start) == s]
    columns = np.hstack([way.columns for way in own])
    residuals = behind.left(behind.fit.residuals * behind.weight)
    aim = np.concatenate([-residuals, np.zeros(2)])
    shares, *_ = np.linalg.lstsq(np.vstack([columns, np.eye(2)]), aim)
    # Squares of what is left in the noise of each channel, as the fit weights them.
    scale = np.concatenate(
        [np.full(p.stop - p.start, behind.weight[p][0]) for p in observation.slices()]
    )
    after = mean_squares(observation, (residuals + columns @ shares) / scale)
    before = mean_squares(observation, residuals / scale)
    number = counts(observation)
    gain = float(log_likelihood(after, number) - log_likelihood(before, number))
    _, volume = np.linalg.slogdet(columns.T @ columns + np.eye(2))
    assert pair.gain == pytest.approx(gain - 0.5 * (float(shares @ shares) + float(volume)))


def test_a_pair_replaces_what_two_others_were_taken_for(two_missing):
    nominal, behind = two_missing.parent.candidate, two_missing.behind[0]
    of = {way.term.id: way.term for way in two_missing.ways[0]}
    one = refit((trial_fit(nominal.fits, of['viscous_friction'], behind.offset),), nominal)
    seen = trial_fit(one.fits, of['load_cell_bias'], background(one.fit).offset)
    wrong = refit((seen,), one)
    better = better_pair(two_missing, [wrong], 1)
    assert better is not None
    first, both = better
    assert first.candidate.effects == both.effects[:1]
    assert set(both.effects) == {'gravity', 'load_cell_gain'}
    assert both.evidence > wrong.evidence
    right = refit((trial_fit(nominal.fits, of['gravity'], behind.offset),), nominal)
    seen = trial_fit(right.fits, of['load_cell_gain'], background(right.fit).offset)
    assert better_pair(two_missing, [wrong, refit((seen,), right)], 1) is None


def test_one_signal_that_gets_worse_is_seen_beside_others_that_get_better(two_missing):
    fit = two_missing.parent.candidate.fit
    observation, generator = fit.model.observation, np.random.default_rng(1)
    before = 3.0 * generator.normal(size=observation.size)
    better = 0.5 * before
    assert not predicts_worse(observation, before, better)
    worse = better.copy()
    last = observation.slices()[-1]
    worse[last] = 1.5 * before[last]
    assert predicts_worse(observation, before, worse)
    noise = np.ones(observation.size)
    assert not predicts_worse(observation, 0.5 * noise, 0.9 * noise)
