"""Names that are left open, with their probabilities."""

import numpy as np
import pytest

from endoscope_explain import prediction_set
from endoscope_explain.prediction_set import NOTHING, SOMETHING_ELSE, Contest

NEAR = Contest((('gravity',), ('joint_stop', 'contact')), (120.0, 119.0), 40.0, found=True)
FAR = Contest((('gravity',), ('joint_stop',)), (12000.0, 300.0), 0.0, found=True, beyond_form=0.0)
WEAK = Contest((('gravity',),), (3.0,), 60.0, found=False)


@pytest.fixture(autouse=True)
def weights(monkeypatch):
    """Weights of these tests, whatever was derived."""
    set_by_hand = (0.0, 0.5, 0.3, 0.0, 6.0, -4.0, -1.0, -4.0, 0.0)
    monkeypatch.setattr(prediction_set, 'POSTERIOR', set_by_hand)


@pytest.mark.parametrize('contest', [NEAR, FAR, WEAK, Contest((), (), 0.0, found=False)])
def test_probabilities_of_all_hypotheses_sum_to_one(contest):
    posterior = contest.posterior()
    assert sum(posterior.values()) == pytest.approx(1.0)
    assert list(posterior.values()) == sorted(posterior.values(), reverse=True)
    assert set(posterior) == {*contest.names, (NOTHING,), (SOMETHING_ELSE,)}


def test_names_of_about_the_same_evidence_are_about_as_likely():
    assert NEAR.probability('joint_stop') == pytest.approx(NEAR.probability('gravity'), rel=0.3)
    assert FAR.probability('joint_stop') < 0.05 < 0.5 < FAR.probability('gravity')


def test_names_that_are_one_statement_share_their_probability():
    assert NEAR.probability('contact') == NEAR.probability('joint_stop')


def test_where_form_is_worth_more_evidence_tells_less():
    weights = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -3.0, -9.0, 0.0)
    sure, unsure = (
        Contest((('gravity',), ('contact',)), (100.0, 90.0), form, found=True).probabilities(
            weights
        )
        for form in (0.0, 100.0)
    )
    assert sure[0] > 0.99
    assert 1.0 < unsure[0] / unsure[1] < 1.2


def test_what_is_said_is_in_the_set_however_unlikely(monkeypatch):
    monkeypatch.setattr(prediction_set, 'MASS', -1.0)
    assert set(NEAR.left_open('contact')) == {('joint_stop', 'contact')}
    assert set(WEAK.left_open(NOTHING)) == {(NOTHING,)}


def test_a_set_takes_the_likeliest_names_and_goes_further_where_they_are_less_likely(monkeypatch):
    sizes = []
    for mass in np.linspace(0.0, 1.0, 20):
        monkeypatch.setattr(prediction_set, 'MASS', mass)
        left = NEAR.left_open('gravity')
        assert list(left) == list(NEAR.posterior())[: len(left)]
        sizes.append(len(left))
    assert sizes == sorted(sizes)
    assert (sizes[0], sizes[-1]) == (1, 4)
    monkeypatch.setattr(prediction_set, 'MASS', 0.6)
    assert (len(FAR.left_open('gravity')), len(NEAR.left_open('gravity'))) == (1, 2)


def test_alternatives_are_names_alone(monkeypatch):
    monkeypatch.setattr(prediction_set, 'MASS', 1.0)
    assert len(NEAR.left_open('gravity')) == 4
    assert NEAR.alternatives('gravity') == ('joint_stop', 'contact')
    assert NEAR.alternatives('contact') == ('gravity', 'joint_stop')


def test_what_is_found_besides_is_no_other_name():
    rest = NEAR.without({'contact', 'gravity'})
    assert (rest.names, rest.gains) == ((('joint_stop',),), (119.0,))
