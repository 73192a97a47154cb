"""What the contracts of imports in pyproject.toml leave open: who may know an effect by name."""

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path

from endoscope_core.physics.effects import CATALOGUE

WORKSPACE = Path(__file__).parents[1] / 'ros_ws'


def _words(tree: ast.Module) -> Iterator[str]:
    """Yield strings and names: of variables, attributes, arguments, functions and modules."""
    for node in ast.walk(tree):
        for field in ('value', 'id', 'attr', 'arg', 'name', 'module'):
            word = getattr(node, field, None)
            if isinstance(word, str):
                yield from (word, word.split('.')[-1])


def test_the_contracts_hold_for_all_packages() -> None:
    settings = tomllib.loads((WORKSPACE / 'pyproject.toml').read_text())
    assert settings['tool']['importlinter']['root_packages'] == sorted(
        path.parent.name for path in WORKSPACE.glob('src/*/package.xml')
    )


def test_the_engine_names_no_effect() -> None:
    engine = WORKSPACE / 'src' / 'endoscope_explain' / 'endoscope_explain'
    found = {
        str(path.relative_to(engine)): named
        for path in sorted(engine.rglob('*.py'))
        if (named := CATALOGUE.keys() & set(_words(ast.parse(path.read_text(encoding='utf-8')))))
    }
    assert found == {}, 'what the engine must know of an effect, the effect says by its traits'
