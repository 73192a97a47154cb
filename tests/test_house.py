"""Who may import whom, and who may know an effect by name."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from endoscope_core.physics.effects import CATALOGUE

SOURCES = Path(__file__).parents[1] / 'ros_ws' / 'src'
HOUSE: list[tuple[str, set[str]]] = [
    ('core', set()),
    ('bags', {'core'}),
    ('devices', {'core'}),
    ('emulators', {'core', 'devices'}),
    ('explain', {'core', 'bags'}),
    ('nodes', {'core', 'bags', 'devices'}),
    ('console', {'core', 'bags', 'nodes'}),
    ('bringup', {'core', 'bags', 'devices', 'explain', 'nodes'}),
    (
        'benchmarks',
        {'core', 'bags', 'devices', 'emulators', 'explain', 'nodes', 'console', 'bringup'},
    ),
]
"""Packages in their order, each with those before it that it and its tests may import."""

ONLY_BY_TESTS = {'bringup': {'emulators'}}
"""Packages before one that its tests may import, and it may not."""

ROOMS = {
    'explain': (
        *('criteria', 'explanation', 'parallel', 'recording', 'observe', 'audit', 'simulation'),
        *('fit', 'search', 'decide', 'case', 'locate', 'compare', 'design'),
        *('explain_recording', 'pipeline', 'shared_physics', 'report', 'many_bags'),
        *('notebook', '__init__'),
    ),
    'nodes': (
        *('names', 'topics', 'runtime', 'safety', 'client', 'nodes', 'node_help', 'program'),
        *('carried_rate', 'graph', 'healthcheck', '__init__'),
    ),
}
"""Rooms of packages in their order: one imports only rooms before it."""


def _trees(folder: Path) -> Iterator[tuple[Path, ast.Module]]:
    for path in sorted(folder.rglob('*.py')):
        yield path.relative_to(SOURCES), ast.parse(path.read_text(encoding='utf-8'))


def _imported(tree: ast.Module) -> Iterator[str]:
    """Yield the packages of the house that a file imports, wherever in the file it does."""
    for node in ast.walk(tree):
        modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            modules = [node.module]
        for module in modules:
            if module.startswith('endoscope_'):
                yield module.split('.')[0].removeprefix('endoscope_')


def _words(tree: ast.Module) -> Iterator[str]:
    """Yield strings and names: of variables, attributes, arguments, functions and modules."""
    for node in ast.walk(tree):
        for field in ('value', 'id', 'attr', 'arg', 'name', 'module'):
            word = getattr(node, field, None)
            if isinstance(word, str):
                yield from (word, word.split('.')[-1])


def test_the_house_has_these_packages() -> None:
    assert {path.parent.name for path in SOURCES.glob('*/package.xml')} == {
        f'endoscope_{name}' for name, _ in HOUSE
    }
    for k, (name, before) in enumerate(HOUSE):
        assert before <= {earlier for earlier, _ in HOUSE[:k]}, name


@pytest.mark.parametrize(('name', 'before'), HOUSE, ids=[name for name, _ in HOUSE])
def test_a_package_imports_only_packages_before_it(name: str, before: set[str]) -> None:
    found = {
        str(path): beyond
        for path, tree in _trees(SOURCES / f'endoscope_{name}')
        if (beyond := set(_imported(tree)) - before - {name} - _more_for_tests(name, path))
    }
    assert found == {}


def _more_for_tests(name: str, path: Path) -> set[str]:
    return ONLY_BY_TESTS.get(name, set()) if path.parts[1] == 'test' else set()


def _rooms_imported(package: str, tree: ast.Module) -> Iterator[str]:
    """Yield the rooms of a package that a file of it imports from."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            first, *rest = node.module.split('.')
            if first == package:
                yield from rest[:1] or [alias.name for alias in node.names]


@pytest.mark.parametrize(('name', 'rooms'), ROOMS.items(), ids=ROOMS)
def test_a_room_imports_only_rooms_before_it(name: str, rooms: tuple[str, ...]) -> None:
    package = f'endoscope_{name}'
    inside = SOURCES / package / package
    order = {room: k for k, room in enumerate(rooms)}
    there, beyond = set(), {}
    for path, tree in _trees(inside):
        room = (SOURCES / path).relative_to(inside).parts[0].removesuffix('.py')
        there.add(room)
        later = {
            other for other in _rooms_imported(package, tree) if order.get(other, -1) > order[room]
        }
        if later:
            beyond[str(path)] = later
    assert beyond == {}
    assert there == set(rooms)


def test_the_engine_names_no_effect() -> None:
    found = {
        str(path): named
        for path, tree in _trees(SOURCES / 'endoscope_explain' / 'endoscope_explain')
        if (named := CATALOGUE.keys() & set(_words(tree)))
    }
    assert found == {}, 'what the engine must know of an effect, the effect says by its traits'
