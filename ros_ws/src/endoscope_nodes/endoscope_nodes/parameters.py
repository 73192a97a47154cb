"""Node parameters as frozen dataclasses, each value checked before a node starts to act.

rclpy accepts a NaN, a value out of range without a descriptor, and a misspelt override without a
word.  Here each of them is one error that names the parameter and what would be right.
"""

import dataclasses
import difflib
import math
import typing
from collections.abc import Callable, Iterable
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter


class ParameterError(ValueError):
    """A parameter that a node refuses to start with."""


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = '',
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    dynamic: bool = False,
) -> Any:
    """Describe one parameter as a dataclass field.

    Parameters
    ----------
    default
        Value where nothing else is given: bool, int, float, str, or a tuple of float or str.
    description, unit
        What it does, shown by ``ros2 param describe``.
    low, high
        Inclusive limits of a number (of each number of a tuple).
    choices
        The only strings allowed; empty for any.
    dynamic
        Whether it may change while the node runs.
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
        },
    )


def declare_parameters[P](
    node: Node,
    kind: type[P],
    on_change: Callable[[P], None] | None = None,
    check: Callable[[P], object] | None = None,
) -> P:
    """Declare every field of the dataclass ``kind`` on ``node`` and return its checked values.

    Parameters
    ----------
    on_change
        Called with the new values after a dynamic parameter was set.
    check
        Called with the new values before they are taken; raises `ParameterError` to refuse them.

    Raises
    ------
    ParameterError
        A value is NaN or infinite, of the wrong type, out of range, or not one of the choices.
    """
    fields = {f.name: f for f in dataclasses.fields(kind)}  # type: ignore[arg-type]
    hints = typing.get_type_hints(kind)
    values = {}
    for name, field in fields.items():
        default = list(field.default) if isinstance(field.default, tuple) else field.default
        text = field.metadata['description']
        if field.metadata['unit']:
            text += f' [{field.metadata["unit"]}]'
        descriptor = ParameterDescriptor(
            description=text,
            read_only=not field.metadata['dynamic'],
            dynamic_typing=True,
            additional_constraints=_constraints(field),
        )
        given = node.declare_parameter(name, default, descriptor).value
        values[name] = _checked(node.get_name(), field, hints[name], given)
    current = kind(**values)
    if any(f.metadata['dynamic'] for f in fields.values()):
        _watch(node, fields, hints, current, on_change, check)
    return current


def _watch(
    node: Node,
    fields: dict[str, dataclasses.Field],
    hints: dict[str, Any],
    current: Any,
    on_change: Callable[[Any], None] | None,
    check_all: Callable[[Any], object] | None,
) -> None:
    state = [current]

    def changed(parameters: list[Parameter]) -> dict[str, Any]:
        return {
            p.name: _checked(node.get_name(), fields[p.name], hints[p.name], p.value)
            for p in parameters
            if p.name in fields
        }

    def check(parameters: list[Parameter]) -> SetParametersResult:
        try:
            new = changed(parameters)
            if new and check_all is not None:
                check_all(dataclasses.replace(state[0], **new))
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def apply(parameters: list[Parameter]) -> None:
        new = changed(parameters)
        if new:
            state[0] = dataclasses.replace(state[0], **new)
            if on_change is not None:
                on_change(state[0])

    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(apply)


def _constraints(field: dataclasses.Field) -> str:
    meta = field.metadata
    if meta['choices']:
        return 'one of ' + ', '.join(filter(None, meta['choices']))
    if meta['low'] is None and meta['high'] is None:
        return ''
    low = '-inf' if meta['low'] is None else f'{meta["low"]:g}'
    high = 'inf' if meta['high'] is None else f'{meta["high"]:g}'
    return f'from {low} to {high}'


def _checked(node: str, field: dataclasses.Field, hint: Any, value: Any) -> Any:
    where = f"{node}: parameter '{field.name}'"
    item = typing.get_args(hint)[0] if typing.get_origin(hint) is tuple else None
    if item is not None:
        if value is None or isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
            raise ParameterError(f'{where} is {value!r}; give a list')
        return tuple(_checked_one(where, field, item, v) for v in value)
    return _checked_one(where, field, hint, value)


def _checked_one(where: str, field: dataclasses.Field, kind: Any, value: Any) -> Any:
    constraint = _constraints(field)
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


def check_overrides(nodes: list[Node]) -> None:
    """Refuse parameter overrides that no node declared.

    An override given to every node of a composition alike (without a node's name) need only be
    known to one of them.

    Raises
    ------
    ParameterError
        Names the override and the nearest valid parameter.
    """
    declared = {node: set(node._parameters) for node in nodes}
    given = {node: set(node._parameter_overrides) for node in nodes}
    for node in nodes:
        for name in sorted(given[node]):
            if name in declared[node] or name.startswith('qos_overrides.'):
                continue
            known_elsewhere = any(name in declared[other] for other in nodes)
            if known_elsewhere and all(name in given[other] for other in nodes):
                continue
            near = difflib.get_close_matches(name, sorted(declared[node]), 1, 0.4)
            hint = (
                f"; did you mean '{near[0]}'?"
                if near
                else ('; it has ' + ', '.join(sorted(declared[node])))
            )
            raise ParameterError(f"{node.get_name()}: unknown parameter '{name}'{hint}")
