"""Parameters of nodes as fields of frozen dataclasses: what each may be, and whether a value is.

Nothing here needs ROS; :mod:`endoscope_nodes.runtime.declared_parameters` declares them on a node.
"""

import dataclasses
import difflib
import math
import typing
from collections.abc import Iterable
from typing import Any

from endoscope_core.errors import EndoscopeError


class ParameterError(EndoscopeError, ValueError):
    """A parameter that there is not, or a value that it cannot have."""


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = '',
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    dynamic: bool = False,
    file: bool = False,
) -> Any:
    """Describe one parameter as a dataclass field.

    `default` is a bool, int, float, str, or a tuple of float or str; `low` and `high` are
    inclusive, for each number of a tuple; empty `choices` allow any string. A `file` has its whole
    path, so that a program in another folder finds it by the parameter.
    """
    return dataclasses.field(
        default=default,
        metadata={
            'description': description,
            'unit': unit,
            'low': low,
            'high': high,
            'choices': choices,
            'dynamic': dynamic,
            'file': file,
        },
    )


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
    return tuple(
        Described(
            f.name,
            as_typed(f.default),
            constraints(f),
            f.metadata['unit'],
            f.metadata['dynamic'],
            f.metadata['description'],
        )
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
    constraint = constraints(field)
    wanted = {
        bool: 'true or false',
        int: 'a whole number',
        float: 'a finite number',
        str: 'a text',
    }[kind]
    wanted += f', {constraint}' if constraint else ''
    if kind is float and type(value) is int:
        value = float(value)
    if type(value) is not kind:
        raise ParameterError(f'{where} is {value!r}; give {wanted}')
    if kind in (int, float):
        low, high = field.metadata['low'], field.metadata['high']
        if (
            not math.isfinite(value)
            or (low is not None and value < low)
            or (high is not None and value > high)
        ):
            raise ParameterError(f'{where} is {value!r}; give {wanted}')
    if kind is str and field.metadata['choices'] and value not in field.metadata['choices']:
        raise ParameterError(f'{where} is {value!r}; give {wanted}{_nearest(value, field)}')
    return value


def _nearest(value: str, field: dataclasses.Field) -> str:
    near = difflib.get_close_matches(value, field.metadata['choices'], 1, 0.5)
    return f' (did you mean {near[0]}?)' if near else ''
