"""The state that all pages receive: graph, lease and dead-man, as one object of JSON."""

import math
import os
import time
from collections import Counter
from typing import Any

import msgspec

from endoscope_console.alarms import FORCE, GUARD, Alarm, TipAlarms, Urgency, number, tip_state
from endoscope_console.clients import UNATTENDED_NS
from endoscope_console.command import SLOWEST_HZ
from endoscope_console.graph_side import GraphSide, is_calibrated
from endoscope_console.operations import Operations
from endoscope_console.teleop.operator import STATE_NS, DeadManState, Reason
from endoscope_core.rig import Rig
from endoscope_nodes.client.calibration_result import NONE_OF_THEM
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import (
    COMMANDS,
    LOCK_STEP,
    MASTER,
    RECORDER,
    SUPERVISOR,
    WATCH,
    Health,
)
from endoscope_nodes.client.plant_adoption import PlantInForce
from endoscope_nodes.names import BAG, LEARNING, WIRES

_LEVELS = ('ok', 'warning', 'error', 'stale')
_TENSE = 0.9
_LOST_S = 0.5
_SLOW = 0.9
_REPEATED_NS = 1_000_000_000
_OF_A_BUSY_MACHINE = (Reason.SILENT, Reason.LATE, Reason.BLIND, Reason.STALLED)
_UNATTENDED = f'enabled, and nobody operates: paused after {UNATTENDED_NS / 1e9:.0f} s'
_encode = msgspec.json.Encoder().encode


class View:
    """Assembles the state, and detects changes."""

    def __init__(self, operations: Operations, rig: Rig, counts: Counter[str], rate: int) -> None:
        self._operations = operations
        self._rig = rig
        self._counts = counts
        self._rate = rate
        self._tip_alarms = TipAlarms(rig.tip.force_alarm)
        self._sent: dict[str, Any] = {}
        self._sent_ns = 0

    def changes(self, now_ns: int) -> str:
        """The state as JSON where it has changed, and once a second; else empty."""
        now = self._steady(now_ns)
        if now == self._sent and now_ns - self._sent_ns < _REPEATED_NS:
            return ''
        self._sent, self._sent_ns = now, now_ns
        return self.whole(now_ns)

    def whole(self, now_ns: int) -> str:
        """The whole state as JSON, at a steady time in ns."""
        steady = self._sent or self._steady(now_ns)
        recorder = self._client.health.get(RECORDER)
        return _encode(
            {
                **steady,
                'stamp': time.time(),
                'state_age': self._state_age_s(now_ns),
                'time': self._time(),
                'recorder': {
                    **steady['recorder'],
                    'messages': None if recorder is None else number(recorder, 'messages'),
                },
                'nodes': self._nodes(),
                'counters': dict(self._counts)
                | {
                    'pictures': self._graph.pictures.seq,
                    'pictures dropped': self._counts['pictures dropped']
                    + self._operations.controls.clients.dropped,
                    'malformed messages': self._graph.pictures.malformed,
                },
            }
        ).decode()

    @property
    def _graph(self) -> GraphSide:
        return self._operations.controls.graph

    @property
    def _client(self) -> GraphClient:
        return self._operations.controls.graph.client

    def _state_age_s(self, now_ns: int) -> float | None:
        heard_ns = self._graph.heard_ns
        return (now_ns - heard_ns) * 1e-9 if heard_ns else None

    def _steady(self, now_ns: int) -> dict[str, Any]:
        """The part of the state whose changes are sent at once."""
        operations, client = self._operations, self._client
        dead_man = operations.controls.beat.report
        engaged = dead_man.state is DeadManState.ENGAGED
        alarms = operations.alarms.update({a.id: a for a in self._alarms(now_ns)})
        settings, pictures, order = self._graph.settings, self._graph.pictures, client.underway
        return {
            'op': 'state',
            'operating_state': client.state,
            'session': client.session,
            'why': client.why,
            'causes': self._causes(),
            'graph_ended': self._graph.ended is not None,
            'lease': {
                'holder': operations.controls.lease.holder,
                'operators': [
                    {'name': c.id, 'label': c.label, 'role': c.role}
                    for c in operations.controls.clients.of('command')
                ],
            },
            'dead_man': {
                'state': dead_man.state,
                'reason': dead_man.reason or '',
                'missing': dead_man.missing or '',
                'grips': operations.controls.beat.grips,
                'following': engaged and pictures.wanted is not None and pictures.drives,
                'counts': dead_man.counts,
            },
            'calibration': {
                'running': order is not None,
                'step': '' if order is None else order.words,
                'progress': 0.0 if order is None else order.progress,
                'result': result(client.calibration),
            },
            'compensator': _compensator(client.compensator),
            'adopted': _adopted(self._graph.plants.in_force),
            'recorder': _recorder(client.health.get(RECORDER)),
            'console': {'source': settings.source, 'scale': settings.scale},
            'tip': tip_state(client.health.get(FORCE), pictures.force_age_s),
            'playing': self._playing(),
            'prepares': operations.controls.playing.prepares,
            'investigates': operations.controls.playing.investigates,
            'alarms': alarms,
            'explanations': operations.explanations.as_list(),
            'investigations': operations.investigations.as_list(),
        }

    def _time(self) -> str:
        health = self._client.health.get(LOCK_STEP)
        return 'real' if health is None else f'simulated, {health.message}'

    def _causes(self) -> list[str]:
        health = self._client.health.get(SUPERVISOR)
        text = '' if health is None else health.values.get('present causes', '')
        return [cause for cause in text.split('; ') if cause]

    def _playing(self) -> dict[str, Any] | None:
        if not self._graph.plays:
            return None
        health = self._client.health.get(MASTER)
        done, length = (
            None if health is None else number(health, f'{key} [s]')
            for key in ('progress', 'length')
        )
        share = done / length if done is not None and length else 0.0
        return {'what': self._graph.settings.source, 'progress': share}

    def _refused(self) -> str:
        """Message about commands that are refused rather than obeyed, if any."""
        parts = [self._client.health.get(name) for name in COMMANDS]
        return next((health.message for health in parts if health and health.level == 2), '')

    def _nodes(self) -> list[dict[str, Any]]:
        now_ns = time.time_ns()
        nodes: dict[str, dict[str, Any]] = {}
        for part, health in sorted(self._client.health.items()):
            name, _, subcomponent = part.partition(': ')
            message = f'{subcomponent}: {health.message}' if health.level else 'ok'
            node = nodes.setdefault(
                name, {'name': name, 'level': _LEVELS[0], 'message': 'ok', 'age': math.inf}
            )
            if _level(health) > _LEVELS.index(node['level']):
                node |= {'level': _LEVELS[_level(health)], 'message': message}
            node['age'] = min(node['age'], (now_ns - health.received_ns) * 1e-9)
        return list(nodes.values())

    def _alarms(self, now_ns: int) -> list[Alarm]:
        """Conditions that need attention now."""
        if self._graph.ended is not None:
            # All else follows from it.
            why = f'the graph has ended with status {self._graph.ended}'
            how = 'restart: Ctrl-C in the terminal, then `endoscope console`'
            return [Alarm('graph', Urgency.HIGH, f'{why}; {how}')]
        client, operations = self._client, self._operations
        age_s = self._state_age_s(now_ns)
        enabled = client.state == 'ENABLED'
        silent = age_s is None or age_s > 1e-9 * STATE_NS
        tension = max(zip(self._graph.pictures.tensions, WIRES, strict=False), default=None)
        recorder = client.health.get(RECORDER)
        compensator = client.compensator
        watch = client.health.get(WATCH)
        reason = operations.controls.beat.report.reason
        factor = client.factor
        found: list[Alarm] = []

        def note(name: str, level: Urgency, text: str, latched: bool = False) -> None:
            found.append(Alarm(name, level, text, latched))

        if client.state == 'FAULT':
            note('fault', Urgency.HIGH, client.why or 'the slave is in FAULT', latched=True)
        if operations.controls.attendance.lacks:
            note('unattended', Urgency.HIGH, _UNATTENDED, latched=True)
        if silent and enabled:
            note('supervisor', Urgency.HIGH, 'the supervisor is silent')
        elif silent:
            note('graph', Urgency.LOW, 'no supervisor is heard')
        elif self._graph.pictures.tracked_age_s > _LOST_S:
            note('tracker', Urgency.MEDIUM, 'the tracker is silent')
        if reason in _OF_A_BUSY_MACHINE:
            note('dead_man', Urgency.MEDIUM, f'the dead-man was released: {reason}')
        if not is_calibrated(client.calibration) and not silent:
            note('calibration', Urgency.LOW, 'not calibrated')
        if compensator is not None and compensator.values.get('mode') == 'none':
            note('compensator', Urgency.LOW, 'nothing is compensated')
        if watch is not None and _LEVELS[_level(watch)] == 'warning':
            note('watch', Urgency.MEDIUM, watch.message)
        elif watch is not None and watch.message.startswith(LEARNING):
            note('watch', Urgency.LOW, f'the watch is {watch.message}')
        if tension is not None and tension[0] > _TENSE * self._rig.tension.ceiling:
            above = f'{tension[1]} is above {_TENSE * self._rig.tension.ceiling:.0f} N'
            note('tension', Urgency.HIGH, above)
        load, cores = os.getloadavg()[0], len(os.sched_getaffinity(0))
        slow = factor is not None and factor < _SLOW
        if slow or (reason in _OF_A_BUSY_MACHINE and load > cores):
            note('busy', Urgency.MEDIUM, busy(load, cores, factor if slow else None, self._rate))
        refused = self._refused()
        if refused and enabled:
            note('refused', Urgency.MEDIUM, refused)
        if recorder is not None and recorder.level:
            note('recorder', Urgency.MEDIUM, recorder.message)
        guard = client.health.get(GUARD)
        return [*found, *self._tip_alarms.update(now_ns, self._graph.pictures.push, guard)]


def busy(load: float, cores: int, pace: float | None, rate: int) -> str:
    """Message that the machine is too busy, by how much, with the remedy."""
    by = f'load {load:.0f} on {cores} core{"s" * (cores != 1)}'
    by += '' if pace is None else f', simulated at {pace:.1f} of real time'
    how = 'close other pages, viewers and programs'
    slower = f', or start the console with --rate {SLOWEST_HZ}'
    return f'the machine is too busy ({by}): {how}{slower if rate > SLOWEST_HZ else ""}'


def result(health: Health | None) -> dict[str, Any] | None:
    """The last calibration, for a person: in degrees."""
    if health is None:
        return None
    size, low, high = (
        None if (value := number(health, f'regressed_size{end}')) is None else math.degrees(value)
        for end in ('', '_low', '_high')
    )
    return {
        'class_deg': number(health, 'class_deg'),
        'none': health.values.get('class_deg') == NONE_OF_THEM,
        'probability': number(health, 'probability'),
        'size_deg': number(health, 'backlash_size_deg') if size is None else size,
        'low_deg': low,
        'high_deg': high,
        'level': _LEVELS[_level(health)],
        'message': health.message,
    }


def _level(health: Health) -> int:
    return min(health.level, len(_LEVELS) - 1)


def _compensator(health: Health | None) -> dict[str, Any]:
    values = {} if health is None else health.values
    mode = values.get('mode', '')
    return {'mode': mode, 'wanted': values.get('wanted_mode', mode)}


def _adopted(plant: PlantInForce | None) -> dict[str, Any] | None:
    """Which adopted plant is in force, in words; None before one is reported."""
    if plant is None:
        return None
    return {'hash': plant.hash, 'words': plant.words, 'undo': bool(plant.hash)}


def _recorder(health: Health | None) -> dict[str, Any]:
    bag = '' if health is None else health.values.get(BAG, '')
    return {
        'recording': bool(bag),
        'bag': bag,
        'message': 'silent' if health is None else health.message,
    }
