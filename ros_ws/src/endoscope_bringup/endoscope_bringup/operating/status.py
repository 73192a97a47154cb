"""Status of a graph, for a person and for a program."""

import math
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from endoscope_core.rig import kind_from_text
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import (
    LOCK_STEP,
    MASTER,
    RECORDER,
    SUPERVISOR,
    WATCH,
    Health,
)
from endoscope_nodes.names import BAG, CEILING, FACTOR, GEAR, JOINTS, REACH, RIG_KIND, SPEED, TIME
from endoscope_nodes.program import NODES

_LEVELS = ('ok', 'WARN', 'ERROR', 'STALE')
_FULL_ROUND_S = 1.1
# It publishes nothing on /diagnostics.
_QUIET = ('replay',)
_NOT_HEARD = 'not heard'


def status_of(client: GraphClient, patience_s: float) -> tuple[tuple[str, ...], dict[str, Any]]:
    """Wait for the diagnostics of every node, for at most so many seconds; returns the status."""
    kinds: list[str] = []

    def note(data: bytes, _: int) -> None:
        kinds.append(str(kind_from_text(deserialize_message(data, String).data)))

    client.listen(String, RIG_KIND, note, latched=True)
    # Nodes publish once a second; those that are found last would be missed otherwise.
    client.wait_until(lambda: False, _FULL_ROUND_S)
    client.wait_until(lambda: not _not_heard(client), patience_s)
    health, not_heard = client.health, _not_heard(client)
    master, recorder = health.get(MASTER), health.get(RECORDER)
    source = '' if master is None else master.values.get('source', '')
    bag = '' if recorder is None else recorder.values.get(BAG, '')
    values = {
        'state': client.state,
        'why': client.why,
        'session': client.session,
        'time': {'simulated': _is_simulated(health), FACTOR: client.factor},
        'rig': {'kind': kinds[-1] if kinds else None, **_in_force(health)},
        'nodes': {
            name: {'level': _LEVELS[part.level], 'message': part.message, 'values': part.values}
            for name, part in sorted(health.items())
        },
        'not_heard': not_heard,
        'compensator': _of_json(client.compensator),
        'calibration': _of_json(client.calibration),
        'recorder': {'bag': bag, 'message': recorder.message if recorder else ''},
        'master_source': source,
    }
    lines = (
        *_entry('state', [_state(client)]),
        *_entry('session', [(client.session or 'none') if client.graph_ns else _NOT_HEARD]),
        *_entry('time', [_time(health)]),
        *_entry('rig', [kinds[-1] if kinds else _NOT_HEARD, *_limits(health)]),
        *_entry('master', [_master(source, master)]),
        *_entry('compensator', [client.compensator.message if client.compensator else _NOT_HEARD]),
        *_entry(
            'calibration',
            calibration_in_words(client.calibration)
            if client.calibration or client.orders
            else [_NOT_HEARD],
        ),
        *_entry('recorder', [_recorder(recorder)]),
        *_entry('watch', [health[WATCH].message] if WATCH in health else []),
        *_entry('nodes', (*_nodes(health), *(f'{name:<13} {_NOT_HEARD}' for name in not_heard))),
    )
    return lines, values


def _not_heard(client: GraphClient) -> list[str]:
    return [
        name
        for name in client.nodes()
        if name in NODES and name not in _QUIET and name not in client.heard_ns
    ]


def _of_json(health: Health | None) -> dict[str, Any] | None:
    return None if health is None else asdict(health)


def _entry(title: str, lines: Iterable[str]) -> list[str]:
    return [f'{title if k == 0 else "":<13}{line}' for k, line in enumerate(lines)]


def _state(client: GraphClient) -> str:
    if SUPERVISOR not in client.health:
        return f'{client.state}; what forbids motion {_NOT_HEARD}'
    if client.why:
        forbidden = 'cannot be enabled: ' if client.state in ('DISABLED', 'PAUSED') else ''
        return f'{client.state}: {forbidden}{client.why}'
    todo = {'DISABLED': 'enable', 'PAUSED': 'resume', 'FAULT': 'enable'}.get(client.state)
    return client.state + (f'; `endoscope operate {todo}` lets it move' if todo else '')


def _is_simulated(health: dict[str, Health]) -> bool | None:
    """Whether time is simulated; None if unknown."""
    if LOCK_STEP in health:
        return True
    supervisor = health.get(SUPERVISOR)
    return None if supervisor is None else supervisor.values[TIME] == 'simulated'


def _time(health: dict[str, Health]) -> str:
    if LOCK_STEP in health:
        return f'simulated, {health[LOCK_STEP].message}'
    return {True: f'simulated, its pace {_NOT_HEARD}', False: 'real', None: _NOT_HEARD}[
        _is_simulated(health)
    ]


def _in_force(health: dict[str, Health]) -> dict[str, float]:
    """Gear and limits by which the supervisor runs; empty before it is heard."""
    supervisor = health.get(SUPERVISOR)
    found = (GEAR, REACH, SPEED, CEILING) if supervisor is not None else ()
    return {name: float(supervisor.values[name]) for name in found if supervisor is not None}


def _limits(health: dict[str, Health]) -> list[str]:
    limits = _in_force(health)
    if not limits:
        return [f'gear and limits {_NOT_HEARD}']
    words = (
        f'gear {limits[GEAR]:g}, joints to {math.degrees(limits[REACH]):.0f} deg at up to '
        f'{math.degrees(limits[SPEED]):.0f} deg/s, wires to {limits[CEILING]:g} N'
    )
    return [words]


def _master(source: str, master: Health | None) -> str:
    if master is None:
        return _NOT_HEARD
    return f'source {source}' + (f': {master.message}' if master.message != source else '')


def _recorder(recorder: Health | None) -> str:
    if recorder is None:
        return _NOT_HEARD
    if not recorder.values.get(BAG):
        return recorder.message
    counts = f'{recorder.values["messages"]} messages, {recorder.values["lost"]} lost'
    return f'{recorder.message} to {recorder.values[BAG]}, {counts}'


def _nodes(health: dict[str, Health]) -> list[str]:
    lines = []
    for node in sorted({name.partition(':')[0] for name in health}):
        parts = {
            name.partition(': ')[2]: status
            for name, status in health.items()
            if name.partition(':')[0] == node
        }
        errors = [
            f'{_LEVELS[status.level]} {part}: {status.message}'
            for part, status in parts.items()
            if status.level
        ]
        lines.append(f'{node:<13} {"; ".join(errors) or "ok"}')
    return lines


def calibration_in_words(result: Health | None) -> tuple[str, ...]:
    """Class with its probability, size with its interval, and how far the tube can be bent."""
    if result is None:
        return ('none yet',)
    values = result.values
    if result.level:
        return (result.message,)
    lines = [result.message]
    if 'regressed_size' in values:
        size, low, high = (
            math.degrees(float(values[f'regressed_size{end}'])) for end in ('', '_low', '_high')
        )
        lines.append(
            f'backlash {size:.1f} deg by the tensions, 90 % between {low:.1f} and {high:.1f} deg'
        )
    if (source := values['backlash_size_from']) != 'cnn':
        lines.append(f'backlash {float(values["backlash_size_deg"]):.1f} deg by the {source}')
    for joint in JOINTS:
        ends = [values.get(f'reach.{joint}.{end}') for end in ('low', 'high')]
        if None not in ends:
            low, high = (math.degrees(float(end)) for end in ends if end is not None)
            lines.append(f'{joint} can be bent from {low:.0f} to {high:.0f} deg')
    return tuple(lines)
