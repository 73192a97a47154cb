"""Declares the parameters of a dataclass on a node, each value checked before the node acts.

rclpy accepts a NaN, a value out of range without a descriptor, and a misspelt override without a
word.  Here each of them is one error that names the parameter and what would be right.
"""

import dataclasses
import difflib
import typing
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from endoscope_nodes.runtime.parameters import ParameterError, checked, constraints


def declare_parameters[P](
    node: Node,
    kind: type[P],
    on_change: Callable[[P], None] | None = None,
    check: Callable[[P], object] | None = None,
) -> P:
    """Declare the fields of the dataclass `kind`; `check` refuses new values by ParameterError."""
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
            additional_constraints=constraints(field),
        )
        given = node.declare_parameter(name, default, descriptor).value
        values[name] = checked(node.get_name(), field, hints[name], given)
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
            p.name: checked(node.get_name(), fields[p.name], hints[p.name], p.value)
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


def check_overrides(nodes: list[Node]) -> None:
    """Refuse parameter overrides that no node declared, naming the nearest valid parameter."""
    declared = {node: set(node.get_parameters_by_prefix('')) for node in nodes}
    given = {node: set(node._parameter_overrides) for node in nodes}  # noqa: SLF001
    for node in nodes:
        for name in sorted(given[node]):
            if name in declared[node] or name.startswith('qos_overrides.'):
                continue
            # An override given to every node of a composition alike (without a node's name) need
            # only be known to one of them.
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
