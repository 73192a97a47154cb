"""Who sends and reads each topic, how often one speaks, and what it says."""

import json
import math
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from itertools import pairwise
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from endoscope_bags.message_types import TF_MESSAGE, typestore
from endoscope_core.errors import nearest, printable
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import GraphError
from endoscope_nodes.names import WIRES
from endoscope_nodes.runtime.recorded_topics import message_class, suitable_qos
from endoscope_nodes.topics import BY_NAME, TOPICS, Topic

_HEADINGS = ('topic', 'type', 'senders', 'readers', '')
_ROS_OWN = ('/parameter_events', '/rosout')
_FOUND_S = 1.0
_PROMPT_S = 0.01
_LEVELS = ('ok', 'WARN', 'ERROR', 'STALE')
_UNITS = {'position': 'rad', 'velocity': 'rad/s', 'effort': 'N m'}


def listing(client: GraphClient, patience_s: float, as_json: bool) -> None:
    """Print all topics of the interface, and others of the namespace."""
    if not client.wait_until(lambda: bool(client.nodes()), patience_s):
        raise GraphError(f'no graph answers in {client.where}: start one with `graph`')
    # The topics of a node become known after its name.
    client.wait_until(lambda: all(_senders(client, t.name) for t in TOPICS), _FOUND_S)
    rows = [_row(client, topic.name, topic) for topic in TOPICS]
    known = {_full(client, topic.name) for topic in TOPICS}
    own = f'{client.node.get_namespace().rstrip("/")}/'
    for name, types in client.node.get_topic_names_and_types():
        if name.startswith(own) and name not in known:
            rows.append(_row(client, name, None) | {'type': types[0]})
    if as_json:
        print(json.dumps(rows))
        return
    table = [_HEADINGS, *(_in_words(row) for row in rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for line in table:
        cells = (cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        print('  '.join(cells).rstrip())


def _row(client: GraphClient, name: str, topic: Topic | None) -> dict[str, Any]:
    readers = [
        info.node_name
        for info in client.node.get_subscriptions_info_by_topic(_full(client, name))
        if info.node_name != client.node.get_name()
    ]
    senders = _senders(client, name)
    missing = []
    if topic is not None and topic.said_by != ('every node',):
        # A master without a source of motion, and clocks of real time, have nothing to say.
        missing = [n for n in topic.said_by if n in client.nodes() and n not in senders]
    return {
        'topic': name,
        'type': topic.type if topic else '',
        'senders': sorted(senders),
        'readers': sorted(readers),
        'missing': _missing(topic, senders, missing),
    }


def _missing(topic: Topic | None, senders: list[str], silent: list[str]) -> str:
    if topic is None:
        return ''
    if topic.one_sender and len(senders) > 1:
        return 'more than the one sender that it has'
    if senders or topic.name == '/clock':
        return ''
    if silent:
        return f'{" and ".join(silent)} does not send it now'
    if topic.said_by:
        return f'no sender: {" or ".join(topic.said_by)} does not run'
    return 'no sender outside the graph'


def _in_words(row: dict[str, Any]) -> tuple[str, ...]:
    senders, readers = (_names(row[side]) for side in ('senders', 'readers'))
    return row['topic'], row['type'], senders, readers, row['missing']


def _names(names: list[str]) -> str:
    unique = list(dict.fromkeys(names))
    return printable(', '.join(unique)) if len(unique) < 4 else f'{len(unique)} nodes'


def _full(client: GraphClient, name: str) -> str:
    return name if name.startswith('/') else client.node.resolve_topic_name(name)


def _senders(client: GraphClient, name: str) -> list[str]:
    own = client.node.get_name()
    found = client.node.get_publishers_info_by_topic(_full(client, name))
    return [info.node_name for info in found if info.node_name != own]


def _messages(
    client: GraphClient,
    name: str,
    count: int | None,
    seconds: float | None,
    patience_s: float,
) -> Iterator[tuple[bytes, int, type]]:
    """Bytes, time of receipt in ns and class of each message; GraphError where none comes."""
    full = _full(client, name)
    if not client.wait_until(lambda: bool(_senders(client, full)), patience_s):
        raise GraphError(f'nobody sends {name} in {client.where}{_hint(client, name)}')
    kind = message_class(dict(client.node.get_topic_names_and_types())[full][0])
    publishers = client.node.get_publishers_info_by_topic(full)
    waiting: list[tuple[bytes, int]] = []
    client.listen(
        kind,
        full,
        lambda data, received_ns: waiting.append((data, received_ns)),
        qos=suitable_qos(False, publishers),
    )
    if not client.wait_until(lambda: bool(waiting), patience_s):
        raise GraphError(f'{name} has senders, but has been silent for {patience_s:g} s')
    end = math.inf if seconds is None else time.monotonic() + seconds
    given = 0
    while True:
        fresh, waiting[:] = waiting[:], []
        for data, received_ns in fresh:
            yield data, received_ns, kind
            given += 1
            if count is not None and given >= count:
                return
        if time.monotonic() > end:
            return
        client.serve(_PROMPT_S)
        client.hear()


def _hint(client: GraphClient, name: str) -> str:
    own = f'{client.node.get_namespace().rstrip("/")}/'
    there = [n.removeprefix(own) for n, _ in client.node.get_topic_names_and_types()]
    there = [n for n in there if n not in _ROS_OWN and _senders(client, n)]
    if not there:
        return ': start a graph with `graph`'
    return '' if name in BY_NAME else f'; {nearest(name, there)}'


def rate(
    client: GraphClient,
    name: str,
    count: int | None,
    seconds: float | None,
    patience_s: float,
    as_json: bool,
) -> None:
    """Measure until so many messages or seconds, or Ctrl-C, and print the statistics."""
    times: list[int] = []
    try:
        for _, received_ns, _ in _messages(client, name, count, seconds, patience_s):
            times.append(received_ns)
    except KeyboardInterrupt:
        pass
    gaps = [(b - a) * 1e-6 for a, b in pairwise(times)]
    if not gaps:
        raise GraphError(f'{name}: {len(times)} message came: too few for a rate')
    mean, spread = statistics.fmean(gaps), statistics.pstdev(gaps)
    figures = {
        'messages': len(times),
        'rate_hz': 1e3 / mean if mean else math.inf,
        'gap_min_ms': min(gaps),
        'gap_max_ms': max(gaps),
        'gap_std_ms': spread,
    }
    if as_json:
        print(json.dumps({'topic': name} | figures))
        return
    print(
        f'{name}: {figures["rate_hz"]:.1f} Hz over {len(times)} messages; gaps from '
        f'{figures["gap_min_ms"]:.2f} to {figures["gap_max_ms"]:.2f} ms, std {spread:.2f} ms'
    )


def echo(
    client: GraphClient,
    name: str,
    count: int | None,
    seconds: float | None,
    patience_s: float,
    as_json: bool,
) -> None:
    """Print messages as they come."""
    say: Callable[[Any], None] = _print_json if as_json else _print_lines
    for data, _, kind in _messages(client, name, count, seconds, patience_s):
        say(_decoded(data, kind))


def _decoded(data: bytes, kind: type) -> Any:
    if hasattr(kind, 'get_fields_and_field_types'):
        return deserialize_message(data, kind)
    return typestore().deserialize_cdr(data, TF_MESSAGE)


def _print_json(message: Any) -> None:
    print(json.dumps(fields_of(message)), flush=True)


def _print_lines(message: Any) -> None:
    for line in lines_of(message):
        print(printable(line), flush=True)


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
