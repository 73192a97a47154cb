"""Parameters of the nodes of a running graph, by name and as text."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml
from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.msg import ParameterType as Kind
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParametersAtomically,
)
from rclpy.parameter import Parameter, parameter_value_to_python

from endoscope_core.errors import nearest
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import PATIENCE_S, GraphError
from endoscope_nodes.runtime.parameters import ParameterError

_ROS_OWN = ('qos_overrides.', 'start_type_description_service')
_WANTED = {
    Kind.PARAMETER_BOOL: (bool, 'true or false'),
    Kind.PARAMETER_INTEGER: (int, 'a whole number'),
    Kind.PARAMETER_DOUBLE: (float, 'a number'),
    Kind.PARAMETER_STRING: (str, 'a text'),
    Kind.PARAMETER_BOOL_ARRAY: (bool, 'a list of true and false'),
    Kind.PARAMETER_INTEGER_ARRAY: (int, 'a list of whole numbers'),
    Kind.PARAMETER_DOUBLE_ARRAY: (float, 'a list of numbers'),
    Kind.PARAMETER_STRING_ARRAY: (str, 'a list of texts'),
}


@dataclass(frozen=True)
class GraphParameter:
    """A parameter as its node has it."""

    node: str
    name: str
    value: Any
    description: str  # what it means, unit at the end in brackets, and its bounds
    type: int  # one of rcl_interfaces/msg/ParameterType

    def parse(self, text: str) -> Any:
        """Read a value of this parameter's type."""
        kind, wanted = _WANTED[self.type]
        if self.type >= Kind.PARAMETER_BOOL_ARRAY or self.type == Kind.PARAMETER_BYTE_ARRAY:
            listed = text.strip().removeprefix('[').removesuffix(']')
            parts = [part.strip() for part in listed.split(',')] if listed.strip() else []
            values = [_one(kind, part) for part in parts]
            wrong = any(value is None for value in values)
            value: Any = values
        else:
            value = _one(kind, text)
            wrong = value is None
        if wrong:
            raise ParameterError(f'{self.node}.{self.name} is {wanted}, not {text!r}')
        return value


def _one(kind: type, text: str) -> Any:
    """Read one value; None where it is none."""
    if kind is str:
        return text
    try:
        value = yaml.safe_load(text)
        # YAML takes 1e-3 for a text.
        value = float(text) if kind is float and not isinstance(value, bool) else value
    except (ValueError, yaml.YAMLError):
        return None
    return value if type(value) is kind else None


def node_and_parameter(name: str) -> tuple[str, str]:
    """Split ``NODE.PARAMETER``."""
    node, _, parameter = name.strip('/').partition('.')
    if not node or not parameter:
        raise ParameterError(f'{name!r}: give NODE.PARAMETER, for example compensator.mode')
    return node, parameter


def read_parameter(
    client: GraphClient, name: str, patience_s: float = PATIENCE_S
) -> GraphParameter:
    """Ask for ``NODE.PARAMETER``; ParameterError names the nearest that there is."""
    node, parameter = node_and_parameter(name)
    own = _names(client, node, patience_s)
    if parameter not in own:
        raise ParameterError(f'no parameter {name}; {nearest(parameter, sorted(own))}')
    return _read(client, node, [parameter], patience_s)[0]


def read_parameters(
    client: GraphClient, node: str, patience_s: float = PATIENCE_S
) -> list[GraphParameter]:
    """Ask a node for all of its parameters, in the order of their names."""
    return _read(client, node, sorted(_names(client, node, patience_s)), patience_s)


def _names(client: GraphClient, node: str, patience_s: float) -> list[str]:
    """Names of the parameters of a node, without those that ROS gives every one."""
    # A node whose parameters can be asked for is known by that service.
    service = f'{node}/describe_parameters'
    if not client.wait_until(
        client.client(DescribeParameters, service).service_is_ready, patience_s
    ):
        others = client.nodes()
        if not others:
            raise GraphError(f'no graph answers in {client.where}: start one with `graph`')
        if node in others:
            raise GraphError(f'{node} does not answer in {client.where}')
        raise ParameterError(f'no node {node} in {client.where}; {nearest(node, sorted(others))}')
    known = client.call(
        ListParameters, f'{node}/list_parameters', ListParameters.Request(), patience_s
    ).result.names
    return [name for name in known if not name.startswith(_ROS_OWN)]


def _read(
    client: GraphClient, node: str, names: list[str], patience_s: float
) -> list[GraphParameter]:
    descriptors = client.call(
        DescribeParameters,
        f'{node}/describe_parameters',
        DescribeParameters.Request(names=names),
        patience_s,
    ).descriptors
    values = client.call(
        GetParameters, f'{node}/get_parameters', GetParameters.Request(names=names), patience_s
    ).values
    return [
        GraphParameter(
            node, name, _plain(parameter_value_to_python(value)), _words(descriptor), value.type
        )
        for name, descriptor, value in zip(names, descriptors, values, strict=True)
    ]


def set_parameters(
    client: GraphClient, node: str, values: Mapping[str, Any], patience_s: float = PATIENCE_S
) -> None:
    """Give a node new values of some parameters: all or, where it refuses one, none."""
    kind, service = SetParametersAtomically, f'{node}/set_parameters_atomically'
    parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    result = client.call(kind, service, kind.Request(parameters=parameters), patience_s).result
    if not result.successful:
        raise GraphError(result.reason or f'{node} refused it without a reason')


def _plain(value: Any) -> Any:
    if isinstance(value, str | bytes) or not isinstance(value, Sequence):
        return value
    return list(value)


def _words(descriptor: ParameterDescriptor) -> str:
    bounds = descriptor.additional_constraints
    return descriptor.description + (f'; {bounds}' if bounds else '')
