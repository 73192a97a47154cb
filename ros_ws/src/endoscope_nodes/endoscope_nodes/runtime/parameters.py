"""Parameters of nodes as fields of frozen dataclasses: what each may be, and whether a value is.

Nothing here needs ROS; :mod:`endoscope_nodes.runtime.declared_parameters` declares them on a node.
"""

import dataclasses
import math
import typing
from collections.abc import Iterable
from typing import Any

from endoscope_core.errors import EndoscopeError, nearest

_WORDS = {bool: 'true or false', int: 'a whole number', float: 'a finite number', str: 'a text'}


class ParameterError(EndoscopeError, ValueError):
    """A parameter that there is not, or a value that it cannot have."""


def parameter(
    default: Any,
    description: str,
    unit: str = '',
    low: float | None = None,
    high: float | None = None,
    *,
    choices: tuple[str, ...] = (),
    dynamic: bool = False,
    file: bool = False,
) -> Any:
    """Describe one parameter as a dataclass field.

    `default` is a bool, int, float, str, or a tuple of float or str; `low` and `high` are
    inclusive, for each number of a tuple; empty `choices` allow any string. A `file` has its whole
    path, so that a program in another folder finds it by the parameter.
    """
    bounds = {'unit': unit, 'low': low, 'high': high, 'choices': choices}
    others = {'description': description, 'dynamic': dynamic, 'file': file}
    return dataclasses.field(default=default, metadata=bounds | others)


@dataclasses.dataclass(frozen=True)
class Described:
    """A parameter in words."""

    name: str
    default: str  # as on a command line, for example ``[1, 2]``; ``''`` for an empty text
    allowed: str  # ``from 0 to 3`` or ``one of none, motion``, say; empty where anything goes
    unit: str
    dynamic: bool  # may change while the node runs
    description: str


def described(kind: type) -> tuple[Described, ...]:
    """Describe every parameter of a dataclass."""
    known = ('unit', 'dynamic', 'description')
    return tuple(
        Described(f.name, as_typed(f.default), constraints(f), *(f.metadata[key] for key in known))
        for f in dataclasses.fields(kind)
    )


def as_typed(value: object) -> str:
    """Return a value as it is written on a command line."""
    if isinstance(value, tuple):
        return f'[{", ".join(as_typed(item) for item in value)}]'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        text = f'{value:.6g}'
        return text if set(text) & set('.en') else f'{text}.0'
    return str(value) or "''"


def changed(values: Any) -> dict[str, object]:
    """Return the values of a dataclass of parameters that are not the defaults, by name."""
    return {
        f.name: value
        for f in dataclasses.fields(values)
        if (value := getattr(values, f.name)) != f.default
    }


def constraints(field: dataclasses.Field) -> str:
    """Say what a parameter may be; empty where anything goes."""
    meta = field.metadata
    if meta['choices']:
        return 'one of ' + ', '.join(filter(None, meta['choices']))
    low, high = (None if meta[end] is None else f'{meta[end]:g}' for end in ('low', 'high'))
    if low is None:
        return '' if high is None else f'at most {high}'
    return f'at least {low}' if high is None else f'from {low} to {high}'


def checked(node: str, field: dataclasses.Field, hint: Any, value: Any) -> Any:
    """Return a value as the type of its parameter, if of that type, finite and within bounds."""
    where = f"{node}: parameter '{field.name}'"
    item = typing.get_args(hint)[0] if typing.get_origin(hint) is tuple else None
    if item is not None:
        if value is None or isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
            raise ParameterError(f'{where} is {value!r}; give a list')
        return tuple(_checked_one(where, field, item, v) for v in value)
    return _checked_one(where, field, hint, value)


def _checked_one(where: str, field: dataclasses.Field, kind: Any, value: Any) -> Any:
    if kind is float and type(value) is int:
        value = float(value)
    low, high, choices = (field.metadata[key] for key in ('low', 'high', 'choices'))
    fits = type(value) is kind
    if fits and kind in (int, float):
        above, below = low is None or value >= low, high is None or value <= high
        fits = math.isfinite(value) and above and below
    if not fits:
        wanted = ', '.join(filter(None, (_WORDS[kind], constraints(field))))
        raise ParameterError(f'{where} is {value!r}; give {wanted}')
    if choices and value not in choices:
        raise ParameterError(f'{where} is {value!r}; {nearest(value, filter(None, choices))}')
    return value
