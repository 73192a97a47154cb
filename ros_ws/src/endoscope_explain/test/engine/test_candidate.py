"""What a candidate may hold: each effect and each function once a joint."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from endoscope_core.physics.packing import pack
from endoscope_explain.decide.conclusions import plant_of
from endoscope_explain.fit.model import packed_joint
from endoscope_explain.fit.nominal import nominal_references
from endoscope_explain.observe.observation import observe
from endoscope_explain.search.refit import Candidate
from endoscope_explain.search.term import effects, functions


@pytest.fixture(scope='module')
def described(one_joint):
    """A rig of one joint, and its plant as described."""
    plant = one_joint.rig()
    (observation,) = observe(one_joint.record(plant, one_joint.motion(6.0)), plant)
    _, described = nominal_references(observation, *packed_joint(plant, 'bend_x'))
    return plant, described


@settings(max_examples=15, deadline=None)
@given(picks=st.lists(st.integers(0, 10_000), min_size=1, max_size=4))
def test_whatever_is_put_together_a_joint_holds_each_term_once(described, picks):
    plant, found = described
    terms = ()
    for pick in picks:
        offered = (*effects(found), *functions(found, np.zeros(len(found.residuals))))
        assert not {term.id for term in terms} & {term.id for term in offered}
        chosen = offered[pick % len(offered)]
        model = chosen.added_to(found.model)
        with pytest.raises(ValueError, match=f'{chosen.id} is there already on bend_x'):
            chosen.added_to(model)
        theta = model.begun_at(found.theta)
        slopes = np.zeros((len(found.residuals), len(theta)))
        found = replace(found, model=model, theta=theta, jacobian=slopes)
        terms = (*terms, chosen)
    known = tuple(term for term in terms if not term.is_function)
    made = plant_of(plant, [Candidate(known, (found,), 0.0)])
    assert [each.id for each in made.effects] == [term.id for term in known]
    pack(made)
