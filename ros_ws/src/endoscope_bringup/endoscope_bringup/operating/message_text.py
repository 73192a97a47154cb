"""A ROS message as text: a row for joints, a line a status, and a line a field for the rest."""

import math
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState

from endoscope_nodes.names import WIRES

_LEVELS = ('ok', 'WARN', 'ERROR', 'STALE')
_UNITS = {'position': 'rad', 'velocity': 'rad/s', 'effort': 'N m'}


def lines_of(message: Any) -> list[str]:
    """Put a message into lines, which may hold whatever a stranger wrote."""
    if isinstance(message, JointState):
        return [_joints(message)]
    if isinstance(message, DiagnosticArray):
        return list(_statuses(message))
    rows = list(_leaves('', fields_of(message)))
    return [f'{name}: {value}' if name else str(value) for name, value in rows]


def fields_of(value: Any) -> Any:
    """Turn a message into dicts, lists, numbers and texts that JSON can hold."""
    if hasattr(value, 'get_fields_and_field_types'):
        return {
            name: fields_of(getattr(value, name)) for name in value.get_fields_and_field_types()
        }
    if is_dataclass(value):
        return {field.name: fields_of(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, bytes):
        return list(value) if len(value) != 1 else value[0]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, str | int | float | bool):
        return value
    return [fields_of(item) for item in value]


def _stamp(message: Any) -> str:
    stamp = message.header.stamp
    return f'{stamp.sec}.{stamp.nanosec:09d}'


def _joints(message: JointState) -> str:
    """One row: ``bend_x=+0.1234 rad +0.0010 rad/s``."""
    columns = {quantity: getattr(message, quantity) for quantity in _UNITS}
    cells = []
    for k, name in enumerate(message.name):
        values = [
            f'{column[k]:+.4f} {"N" if name in WIRES and quantity == "effort" else unit}'
            for (quantity, column), unit in zip(columns.items(), _UNITS.values(), strict=True)
            if k < len(column)
        ]
        cells.append(f'{name}={" ".join(values)}')
    of = f'  ({message.header.frame_id})' if message.header.frame_id else ''
    return f'{_stamp(message)}  {"  ".join(cells)}{of}'


def _statuses(message: DiagnosticArray) -> Iterator[str]:
    for status in message.status:
        yield f'{_stamp(message)}  {_LEVELS[status.level[0] % 4]} {status.name}: {status.message}'
        for item in status.values:
            yield f'    {item.key}: {item.value}'


def _leaves(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(f'{name}.{key}' if name else key, inner)
    else:
        yield name, value
