"""When an explanation of a labelled recording counts as right."""

import pytest

from endoscope_lab.explain import judged


def effect(name, alternatives=(), **parameters):
    estimates = {k: {'value': v, 'low': 0.9 * v, 'high': 1.1 * v} for k, v in parameters.items()}
    return {'id': name, 'alternatives': list(alternatives), 'parameters': estimates}


def report(*effects, verdict='missing_physics'):
    return {'verdict': verdict, 'effects': list(effects)}


def truth(*effects, verdict=None, excitation='commissioning', also=(), **comparable):
    return {
        'effects': list(effects),
        'verdict': verdict,
        'excitation': excitation,
        'also_true': list(also),
        'comparable': comparable,
    }


@pytest.mark.parametrize(
    ('said', 'true', 'right', 'exact'),
    [
        (report(effect('gravity')), truth('gravity'), True, True),
        (report(effect('gravity'), effect('cogging')), truth('gravity'), True, False),
        (report(effect('cogging'), effect('gravity')), truth('gravity'), False, False),
        (report(effect('cogging', ('gravity',))), truth('gravity'), False, False),
        (
            report(effect('cogging', ('gravity',))),
            truth('gravity', excitation='calibration'),
            True,
            True,
        ),
        (report(verdict='consistent'), truth(verdict='consistent'), True, True),
        (report(verdict='parameters_differ'), truth(verdict='consistent'), False, False),
        (report(verdict='parameters_differ'), truth(), True, True),
        (report(verdict='unknown_physics'), truth(), False, False),
        (report(effect('uneven_friction')), truth(also=('uneven_friction',)), True, True),
    ],
)
def test_what_counts_as_right(said, true, right, exact):
    outcome = judged(said, true)
    assert (outcome.right, outcome.exact) == (right, exact)


def test_numbers_stand_beside_their_true_values():
    said = report(effect('tracker_delay', delay_s=0.05))
    (line,) = judged(said, truth('tracker_delay', tracker_delay={'delay_s': 0.04})).numbers
    assert line == 'tracker_delay.delay_s: true 0.04, 0.05 [0.045, 0.055]'
