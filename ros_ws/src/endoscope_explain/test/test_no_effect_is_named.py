"""What the engine must know of an effect, the effect's own traits say."""

import ast
from pathlib import Path

import pytest

import endoscope_explain
from endoscope_core.physics.effect import Symptom
from endoscope_core.physics.effects import CATALOGUE, showing

MODULES = sorted(Path(endoscope_explain.__file__).parent.rglob('*.py'))


@pytest.mark.parametrize('path', MODULES, ids=lambda path: path.stem)
def test_no_effect_is_named_in_the_engine(path):
    tree = ast.parse(path.read_text(encoding='utf-8'))
    texts = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    assert texts.isdisjoint(CATALOGUE)


@pytest.mark.parametrize('symptom', Symptom)
def test_a_symptom_is_of_one_effect(symptom):
    assert [e for e in CATALOGUE.values() if e.traits.symptom is symptom] == [showing(symptom)]
