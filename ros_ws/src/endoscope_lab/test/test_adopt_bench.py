"""Rigs of the bench of adopted plants: which effects, how large, and how they are followed."""

import pytest

from endoscope_core.signals import non_periodic_signal
from endoscope_lab.adopt import FOREIGN, KNOWABLE, KNOWN, LARGE, OTHERS, as_adopted, drawn
from endoscope_lab.concealed.forms import DRAWN


def test_an_effect_is_one_that_an_inverse_knows_or_another():
    assert sorted(KNOWABLE + OTHERS) == sorted(DRAWN)
    assert {'gear_backlash', 'gravity'} <= set(KNOWABLE)
    assert {'breathing', 'load_cell_gain'} <= set(OTHERS)


@pytest.mark.parametrize('kind', [KNOWN, FOREIGN])
def test_the_effect_is_large_and_the_better_plant_follows_better(kind):
    rig = drawn(kind, 3)
    assert 0.9 * LARGE[0] <= rig.case.moved <= 1.1 * LARGE[1]
    signal = non_periodic_signal(8.0).scaled(0.3)
    described, better = (
        rig.error(signal, as_adopted(plant).law) for plant in (rig.case.described, rig.case.true)
    )
    assert 0.0 < better < described
