"""Mistakes of people are reported and corrected; physics is not mistaken for them."""

from pathlib import Path

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec, JointParameters, PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.audit import audit_recording
from endoscope_explain.case import Inputs, Sources
from endoscope_explain.explanation import Explanation, Verdict
from endoscope_explain.pipeline import explain_case
from endoscope_lab.mistakes import drawing
from endoscope_lab.mistakes.mistake import MISTAKES, is_reported

SHOWN = (
    'wires of two joints',
    'tensions negative',
    'all stamps in us',
    'tension in kg',
)
"""One mistake of each kind, tried on every change of the code: a place, a sign, a clock, a unit."""
MOST_SIMILAR = ('load_cell_gain', 'load_cell_delay')
"""Physics that is most similar to a mistake."""
STRONGEST = [i for i, effect in CATALOGUE.items() if not effect.traits.audited]


def first(names, tried):
    """All names as parameters, of which those not `tried` on every change are nightly."""
    assert {*tried} <= {*names}
    return [
        pytest.param(name, marks=() if name in tried else pytest.mark.nightly) for name in names
    ]


def seed_of(name):
    return sum(map(ord, name))


@pytest.mark.parametrize('name', first(MISTAKES, SHOWN))
def test_a_mistake_is_reported_and_the_corrected_recording_is_explained(name):
    mistake = MISTAKES[name]
    rng = np.random.default_rng(seed_of(name))
    joints = ('bend_x', 'bend_y')[: mistake.joints]
    recording, _ = drawing.draw_recording(rng, joints, 0.1, 0.0, 0)
    plant = drawing.described(recording)
    audit = audit_recording(mistake.change(recording, rng), plant)
    assert is_reported(mistake, audit), [f.text for f in audit.findings]

    # Only the rig's own forces show how many N a count of its converter is.
    rel = 0.2 if name == 'tension in counts' else 2e-3

    def engine(corrected, *_, **__):
        for quantity, series in corrected.measured().items():
            meant = recording.measured()[quantity]
            judged = series.valid
            assert series.values[judged] == pytest.approx(meant.values[judged], rel=rel, abs=1e-9)
            assert series.time == pytest.approx(meant.time, abs=1e-6)
        return Explanation.without_fit(Verdict.CONSISTENT, plant)

    case = explain_case(Inputs(Sources(Path('rig'), plant), audit), engine)
    assert case.verdict is Verdict.RECORDING_FAULT


@pytest.mark.parametrize('effect_id', first(STRONGEST, MOST_SIMILAR))
def test_the_strongest_physics_is_not_taken_for_a_mistake(effect_id):
    rng = np.random.default_rng(seed_of(effect_id))
    joint = {'bend_x': JointParameters()}
    for strength in (1.0, 0.8, 0.5, 0.2):
        values = drawing.draw_strength(rng, CATALOGUE[effect_id], strength)
        plant = PlantDescription(joints=joint, effects=(EffectSpec(effect_id, 'bend_x', values),))
        at, command = drawing.draw_motion(rng, ('bend_x',))
        recording, survives = drawing.read(plant, at, command, 1)
        if survives:
            break
    else:
        raise AssertionError('the rig survives no strength of the effect')
    audit = audit_recording(recording, PlantDescription(joints=joint))
    assert not audit.mistakes(), [f.text for f in audit.findings]
