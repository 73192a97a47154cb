"""What a package or a room exports says what it is, and in which units it takes its numbers."""

import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

SOURCES = Path(__file__).parents[1] / 'ros_ws' / 'src'

QUANTITY = re.compile(r'\b(float|complex|NDArray|ndarray|ArrayLike|\w*Array)\b')
UNIT = re.compile(
    r"(?<!')\b(rad|deg|s|ms|us|ns|Hz|N|m|mm|A|V|C|SI units|bytes?|ticks?|samples?"
    r'|probabilit\w+|[Rr]elative|in \[0, 1\])'
    r'(?!\w)'
)
"""Also what a number without a unit is."""


def _exported() -> Iterator[tuple[str, object]]:
    """Yield functions and classes of all `__all__`, each by its full name and as it was written."""
    for init in sorted(SOURCES.glob('endoscope_*/endoscope_*/**/__init__.py')):
        room = importlib.import_module('.'.join(init.parent.relative_to(SOURCES).parts[1:]))
        for name in getattr(room, '__all__', ()):
            value = getattr(room, name)
            value = getattr(value, 'py_func', value)
            if inspect.isclass(value) or inspect.isroutine(value):
                yield f'{room.__name__}.{name}', value


def test_exported_names_are_documented() -> None:
    exported = dict(_exported())
    assert len(exported) > 150
    bare, without_units = [], []
    for name, value in exported.items():
        docstring = vars(value).get('__doc__') if inspect.isclass(value) else value.__doc__
        if not docstring or docstring.startswith(f'{value.__name__}('):  # a dataclass writes one
            bare.append(name)
            continue
        if inspect.isclass(value) and issubclass(value, BaseException):
            continue
        taken = inspect.signature(value).parameters.values()
        takes = [one.name for one in taken if QUANTITY.search(str(one.annotation))]
        if takes and not UNIT.search(docstring):
            without_units.append(f'{name} of {", ".join(takes)}')
    assert not bare
    assert not without_units
