"""What a graph says of itself, for a person and for a program."""

import math
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import LOCK_STEP, MASTER, RECORDER, Health
from endoscope_nodes.names import BAG, CLOCK_NODE, FACTOR, JOINTS
from endoscope_nodes.program import NODES

_LEVELS = ('ok', 'WARN', 'ERROR', 'STALE')
_FULL_ROUND_S = 1.1
# These say nothing on /diagnostics.
_QUIET = (CLOCK_NODE, 'replay')


def status_of(client: GraphClient, patience_s: float) -> tuple[tuple[str, ...], dict[str, Any]]:
    """Listen until every node has spoken, at most for so many seconds; what they say."""
    # Nodes speak once a second; those that are found last would be missed otherwise.
    client.wait_until(lambda: False, _FULL_ROUND_S)
    client.wait_until(lambda: not _silent(client), patience_s)
    health, silent = client.health, _silent(client)
    master, recorder = health.get(MASTER), health.get(RECORDER)
    source = '' if master is None else master.values.get('source', '')
    bag = '' if recorder is None else recorder.values.get(BAG, '')
    values = {
        'state': client.state,
        'why': client.why,
        'session': client.session,
        'time': {'simulated': LOCK_STEP in health, FACTOR: client.factor},
        'nodes': {
            name: {'level': _LEVELS[said.level], 'message': said.message, 'values': said.values}
            for name, said in sorted(health.items())
        },
        'silent': silent,
        'compensator': _of_json(client.compensator),
        'calibration': _of_json(client.calibration),
        'recorder': {'bag': bag, 'message': recorder.message if recorder else ''},
        'console_source': source,
    }
    lines = (
        *_entry('state', [_state(client)]),
        *_entry('session', [client.session or 'none']),
        *_entry('time', [_time(health.get(LOCK_STEP))]),
        *_entry('console', [_master(source, master)]),
        *_entry('compensator', [client.compensator.message if client.compensator else 'silent']),
        *_entry('calibration', calibration_in_words(client.calibration)),
        *_entry('recorder', [_recorder(recorder)]),
        *_entry('nodes', (*_nodes(health), *(f'{name:<13} silent' for name in silent))),
    )
    return lines, values


def _silent(client: GraphClient) -> list[str]:
    return [
        name
        for name in client.nodes()
        if name in NODES and name not in _QUIET and name not in client.heard_ns
    ]


def _of_json(said: Health | None) -> dict[str, Any] | None:
    return None if said is None else asdict(said)


def _entry(title: str, lines: Iterable[str]) -> list[str]:
    return [f'{title if k == 0 else "":<13}{line}' for k, line in enumerate(lines)]


def _state(client: GraphClient) -> str:
    if client.why:
        forbidden = 'cannot be enabled: ' if client.state in ('DISABLED', 'PAUSED') else ''
        return f'{client.state}: {forbidden}{client.why}'
    todo = {'DISABLED': 'enable', 'PAUSED': 'resume', 'FAULT': 'enable'}.get(client.state)
    return client.state + (f'; `endoscope operate {todo}` lets it move' if todo else '')


def _time(said: Health | None) -> str:
    return 'real' if said is None else f'simulated, {said.message}'


def _master(source: str, said: Health | None) -> str:
    if said is None:
        return 'silent'
    return f'source {source}' + (f': {said.message}' if said.message != source else '')


def _recorder(said: Health | None) -> str:
    if said is None:
        return 'silent'
    if not said.values.get(BAG):
        return said.message
    counts = f'{said.values["messages"]} messages, {said.values["lost"]} lost'
    return f'{said.message} to {said.values[BAG]}, {counts}'


def _nodes(health: dict[str, Health]) -> list[str]:
    lines = []
    for node in sorted({name.partition(':')[0] for name in health}):
        parts = {
            name.partition(': ')[2]: said
            for name, said in health.items()
            if name.partition(':')[0] == node
        }
        troubles = [
            f'{_LEVELS[said.level]} {part}: {said.message}'
            for part, said in parts.items()
            if said.level
        ]
        lines.append(f'{node:<13} {"; ".join(troubles) or "ok"}')
    return lines


def calibration_in_words(result: Health | None) -> tuple[str, ...]:
    """Class with its probability, size with its interval, and how far the tube can be bent."""
    if result is None:
        return ('none yet',)
    values = result.values
    if result.level:
        return (result.message,)
    lines = [result.message]
    lines.append(
        f'backlash {float(values["backlash_size_deg"]):.1f} deg by the '
        f'{values["backlash_size_from"]}'
    )
    if 'regressed_size' in values:
        size, low, high = (
            math.degrees(float(values[f'regressed_size{end}'])) for end in ('', '_low', '_high')
        )
        lines.append(
            f'size {size:.1f} deg by the tensions, with 90 % between {low:.1f} and {high:.1f} deg'
        )
    for joint in JOINTS:
        ends = [values.get(f'reach.{joint}.{end}') for end in ('low', 'high')]
        if None not in ends:
            low, high = (math.degrees(float(end)) for end in ends if end is not None)
            lines.append(f'{joint} can be bent from {low:.0f} to {high:.0f} deg')
    return tuple(lines)
