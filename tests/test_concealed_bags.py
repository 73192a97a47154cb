"""Fixed recordings with something concealed: what an explanation says of them."""

import json
from pathlib import Path

import pytest

from endoscope_core.physics import load_plant
from endoscope_explain.explain_recording import explain_recording
from endoscope_explain.pipeline import Sources, explain_case, read_inputs

FOLDER = Path(__file__).parents[1] / 'bags' / 'concealed'
BAGS = sorted(FOLDER.glob('*.mcap'))
MOST_LISTED = 3


@pytest.mark.parametrize('bag', BAGS, ids=lambda bag: bag.stem)
def test_what_was_concealed_is_found(bag):
    plant = load_plant(FOLDER / 'plant.yaml')
    case = explain_case(read_inputs(Sources(bag, plant)), explain_recording, extras=False)
    # Opened only now.
    truth = json.loads(bag.with_name(f'{bag.stem}.truth.json').read_text())
    listed = {e.id for e in case.effects} | {x for e in case.effects for x in e.alternatives}
    if truth['verdict'] is not None:
        assert str(case.verdict) == truth['verdict']
    if truth['effects']:
        assert set(truth['effects']) <= listed
        assert len(listed) <= MOST_LISTED
        for effect in case.effects:
            for name, value in truth['comparable'].get(effect.id, {}).items():
                estimate = effect.parameters[name]
                assert estimate.low <= value <= estimate.high


def test_the_fixed_recordings_are_there():
    assert len(BAGS) == 5
