"""Senders and readers of each topic, missing ones, and the messages of a topic."""

import json
import math
import time
from dataclasses import asdict
from typing import Any

from endoscope_bags.message_types import message_type, typestore
from endoscope_bringup.subcommands import print_json_line
from endoscope_core.errors import nearest, printable
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import GraphError
from endoscope_nodes.runtime.recorded_topics import message_class, suitable_qos
from endoscope_nodes.topics import BY_NAME, TOPICS, GraphTopic

_HEADINGS = ('topic', 'type', 'senders', 'readers', '')
_ROS_OWN = ('/parameter_events', '/rosout')
_FOUND_S = 1.0
_PROMPT_S = 0.01


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


def _row(client: GraphClient, name: str, topic: GraphTopic | None) -> dict[str, Any]:
    readers = [
        info.node_name
        for info in client.node.get_subscriptions_info_by_topic(_full(client, name))
        if info.node_name != client.node.get_name()
    ]
    senders = _senders(client, name)
    missing = []
    if topic is not None and topic.said_by != ('every node',):
        # A master without a source of motion, and clocks of real time, publish nothing.
        missing = [n for n in topic.said_by if n in client.nodes() and n not in senders]
    return {
        'topic': name,
        'type': topic.type if topic else '',
        'senders': sorted(senders),
        'readers': sorted(readers),
        'missing': _missing(topic, senders, missing),
    }


def _missing(topic: GraphTopic | None, senders: list[str], silent: list[str]) -> str:
    if topic is None:
        return ''
    if topic.one_sender and len(senders) > 1:
        return 'competing senders: only one is allowed'
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


def echo(
    client: GraphClient,
    name: str,
    count: int | None,
    seconds: float | None,
    patience_s: float,
) -> None:
    """Print messages as they come, each as a line of JSON; GraphError where none comes."""
    full = _full(client, name)
    if not client.wait_until(lambda: bool(_senders(client, full)), patience_s):
        raise GraphError(f'nobody sends {name} in {client.where}{_hint(client, name)}')
    kind = dict(client.node.get_topic_names_and_types())[full][0]
    publishers = client.node.get_publishers_info_by_topic(full)
    waiting: list[bytes] = []
    client.listen(
        message_class(kind),
        full,
        lambda data, _: waiting.append(data),
        qos=suitable_qos(False, publishers),
    )
    if not client.wait_until(lambda: bool(waiting), patience_s):
        raise GraphError(f'{name} has senders, but has been silent for {patience_s:g} s')
    message_type(kind)  # read from its package, where it is not one of the common types
    end = math.inf if seconds is None else time.monotonic() + seconds
    left = math.inf if count is None else count
    while left > 0:
        fresh, waiting[:] = waiting[:], []
        for data in fresh[: int(min(left, len(fresh)))]:
            message: Any = typestore().deserialize_cdr(data, kind)
            print_json_line(asdict(message, dict_factory=_fields))
        left -= len(fresh)
        if time.monotonic() > end:
            return
        client.serve(_PROMPT_S)
        client.hear()


def _fields(items: list[tuple[str, Any]]) -> dict[str, Any]:
    """Those of a message, without the name of its type that `rosbags` puts beside them."""
    return {name: value for name, value in items if name != '__msgtype__'}


def _hint(client: GraphClient, name: str) -> str:
    own = f'{client.node.get_namespace().rstrip("/")}/'
    there = [n.removeprefix(own) for n, _ in client.node.get_topic_names_and_types()]
    there = [n for n in there if n not in _ROS_OWN and _senders(client, n)]
    if not there:
        return ': start a graph with `graph`'
    return '' if name in BY_NAME else f'; {nearest(name, there)}'
