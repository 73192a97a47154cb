"""Declares the parameters of a dataclass on a node, each value checked before the node acts.

rclpy accepts a NaN, a value out of range without a descriptor, and a misspelt override without a
word; rcl gives a node what is addressed to it and drops the rest, so that a misspelt name of a node
leaves it with its defaults.  Here each of them is one error that names what would be right.
"""

import dataclasses
import re
import typing
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from endoscope_core.errors import nearest
from endoscope_nodes.runtime.node_parameters import FOR_SESSION, OF_NODE
from endoscope_nodes.runtime.parameters import ParameterError, checked, constraints

_PARAMETERS = 'ros__parameters'
_ANY = ('*', '**')


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
        override = node._parameter_overrides.get(name)  # noqa: SLF001
        if field.metadata['file'] and override is not None:
            path = override.value
            default = str(Path(path).absolute()) if path and isinstance(path, str) else path
        given = node.declare_parameter(
            name, default, descriptor, ignore_override=field.metadata['file']
        ).value
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
    before: dict[str, Any] = {}  # what falls back when the motion session ends

    def with_what_falls_back(parameters: list[Parameter]) -> list[Parameter]:
        asked = {p.name: p.value for p in parameters}
        if asked.get(FOR_SESSION, True):
            return parameters
        back = [Parameter(name, value=value) for name, value in before.items()]
        return [*parameters, *(p for p in back if p.name not in asked)]

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
        if new.get(FOR_SESSION):
            for name in new:
                before.setdefault(name, getattr(state[0], name))
        elif FOR_SESSION in new:
            before.clear()
        else:
            # What somebody sets meanwhile stays.
            for name in new:
                before.pop(name, None)
        if new:
            state[0] = dataclasses.replace(state[0], **new)
            if on_change is not None:
                on_change(state[0])

    if FOR_SESSION in fields:
        node.add_pre_set_parameters_callback(with_what_falls_back)
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
            hint = nearest(name, sorted(declared[node]))
            raise ParameterError(f"{node.get_name()}: unknown parameter '{name}'; {hint}")


def check_sections(args: Sequence[str], namespace: str) -> list[str]:
    """Refuse parameters for nodes that there cannot be; a line for each section of another rig."""
    # What rcl understands in files: `/NAMESPACE/NODE`, nested or not, where `*` stands for one name
    # and `**` for any number of them (rcl_yaml_param_parser, and the matching of rclcpp and rclpy).
    # A file may serve several processes and rigs, so that a section need not be for a node of this
    # process, but for one of this project.
    renamed = [rule.partition('__node:=')[2] for rule in _values_of(args, ('-r', '--remap'))]
    known = sorted({*OF_NODE, *renamed} - {''})
    for node in given_to_nodes(args):
        # One that is renamed keeps the name of its program here.
        _check(f"'-p {node}:'", f'/**/{node}', sorted(OF_NODE), namespace)
    notes = []
    for file in _values_of(args, ('--params-file',)):
        for section in _sections(file):
            if not _check(f"{file}: section '{section}'", section, known, namespace):
                notes.append(f"{file}: section '{section}' is for no node in {namespace}")
    return notes


def given_to_nodes(args: Sequence[str]) -> dict[str, dict[str, object]]:
    """Values of `-p NODE:NAME:=VALUE` by node; rcl knows them without a namespace alone."""
    found: dict[str, dict[str, object]] = {}
    for rule in _values_of(args, ('-p', '--param')):
        name, _, value = rule.partition(':=')
        node, colon, parameter = name.partition(':')
        if colon:
            found.setdefault(node.strip('/'), {})[parameter] = yaml.safe_load(value)
    return found


def _values_of(args: Sequence[str], options: Sequence[str]) -> list[str]:
    return [value for option, value in pairwise(args) if option in options]


def _check(where: str, section: str, known: Sequence[str], namespace: str) -> bool:
    """Tell whether a section is for a node in this namespace, if there can be such a node."""
    above, _, node = section.rpartition('/')
    if node not in (*_ANY, *known):
        raise ParameterError(f"{where}: there is no node '{node}'; {nearest(node, known)}")
    here = namespace.rstrip('/')
    if here and not above and node not in _ANY:
        raise ParameterError(
            f'{where} is for a node without a namespace, and here they are in {here}; write '
            f"'{here}/{node}' or '/**/{node}' in a parameters file"
        )
    pattern = re.sub(r'/\*\*?', lambda m: r'(/\w+)*' if m[0] == '/**' else r'/\w+', section)
    return any(re.fullmatch(pattern, f'{here}/{name}') for name in known)


def _sections(file: str) -> Iterator[str]:
    # Composed, not loaded: a mapping in Python would hide what is there twice.
    root = yaml.compose(Path(file).read_text(encoding='utf-8-sig'))
    if isinstance(root, yaml.MappingNode):
        yield from _below(file, '', root)


def _below(file: str, above: str, mapping: yaml.MappingNode) -> Iterator[str]:
    for key, value in mapping.value:
        if key.value == _PARAMETERS:
            _check_unique(f"{file}: section '{above}'", value)
            yield above
        elif isinstance(value, yaml.MappingNode):
            yield from _below(file, f'{above}/{key.value.strip("/")}', value)


def _check_unique(where: str, parameters: yaml.Node) -> None:
    if not isinstance(parameters, yaml.MappingNode):
        return
    names = [key.value for key, _ in parameters.value]
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise ParameterError(f"{where} has the parameter '{twice[0]}' twice")
    for key, value in parameters.value:
        _check_unique(f"{where}, '{key.value}'", value)
