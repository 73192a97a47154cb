"""Public names say what they do, and what they document is what they take and raise."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[1] / 'ros_ws' / 'src'
MODULES = sorted(SOURCES.glob('endoscope_*/endoscope_*/**/*.py'))

# What has a unit or a shape is always said; a node or a topic may speak for itself.
QUANTITY = re.compile(r'\b(float|int|complex|NDArray|ndarray|ArrayLike|\w*Array)\b')

Documented = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


def _public_definitions(
    tree: ast.Module,
) -> Iterator[tuple[Documented, ast.ClassDef | None]]:
    """Yield public functions and classes of a module with the class around them."""
    for node in tree.body:
        if isinstance(node, Documented) and not node.name.startswith('_'):
            # What several signatures share is said at the function itself.
            if 'overload' in map(ast.unparse, node.decorator_list):
                continue
            yield node, None
            if isinstance(node, ast.ClassDef):
                for member in node.body:
                    if isinstance(member, Documented) and not member.name.startswith('_'):
                        yield member, node


def _section(docstring: str, title: str) -> str | None:
    """Return the body of a numpydoc section, or None where there is none."""
    found = re.search(
        rf'^{title}\n-+\n(.*?)(?=^\w[\w ]*\n---|\Z)',
        docstring,
        re.MULTILINE | re.DOTALL,
    )
    return found.group(1) if found else None


def _documented_names(section: str) -> list[str]:
    heads = [line for line in section.splitlines() if line and not line[0].isspace()]
    names = [name for head in heads for name in head.split(' : ')[0].split(',')]
    return [name.strip().lstrip('*') for name in names]


def _own_parameters(node: Documented) -> dict[str, str]:
    """Return the parameters with their annotations, for a class those of __init__ or its fields."""
    if isinstance(node, ast.ClassDef):
        for member in node.body:
            if isinstance(member, ast.FunctionDef) and member.name == '__init__':
                return _own_parameters(member)
        return {
            member.target.id: ast.unparse(member.annotation)
            for member in node.body
            if isinstance(member, ast.AnnAssign) and isinstance(member.target, ast.Name)
        }
    arguments = node.args
    every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    every += [argument for argument in (arguments.vararg, arguments.kwarg) if argument]
    return {
        argument.arg: ast.unparse(argument.annotation) if argument.annotation else ''
        for argument in every
        if argument.arg not in ('self', 'cls')
    }


def _accepts_bases(node: Documented) -> bool:
    return isinstance(node, ast.ClassDef) and bool(node.bases)


@pytest.mark.parametrize('module', MODULES, ids=lambda path: str(path.relative_to(SOURCES)))
def test_public_names_are_documented(module: Path) -> None:
    tree = ast.parse(module.read_text(encoding='utf-8'))
    problems = [] if ast.get_docstring(tree) else ['the module has no docstring']
    for node, owner in _public_definitions(tree):
        name = f'{owner.name}.{node.name}' if owner else node.name
        docstring = ast.get_docstring(node)
        if docstring is None:
            # A method that fills in a documented base class is documented there.
            if not (owner and owner.bases):
                problems.append(f'line {node.lineno}: {name} has no docstring')
            continue
        parameters = _section(docstring, 'Parameters')
        if parameters is None:
            continue
        documented = _documented_names(parameters)
        taken = _own_parameters(node)
        unknown = [one for one in documented if one not in taken]
        if unknown and not _accepts_bases(node):
            problems.append(
                f'line {node.lineno}: {name} documents {unknown}, which it does not take'
            )
        missing = [
            one
            for one, kind in taken.items()
            if one not in documented and QUANTITY.search(kind) and not one.startswith('_')
        ]
        if missing:
            problems.append(f'line {node.lineno}: {name} leaves out {missing}')
    assert not problems, '\n'.join(problems)


def test_the_walk_finds_the_packages() -> None:
    assert {path.relative_to(SOURCES).parts[0] for path in MODULES} == {
        'endoscope_bags',
        'endoscope_benchmarks',
        'endoscope_bringup',
        'endoscope_console',
        'endoscope_core',
        'endoscope_devices',
        'endoscope_emulators',
        'endoscope_explain',
        'endoscope_nodes',
    }
