"""The actions of `endoscope operate`, each with what the graph answers."""

import argparse
import json
import math
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from endoscope_bringup.operating.status import calibration_in_words, status_of
from endoscope_bringup.progress_line import ProgressLine
from endoscope_core.safety import ranges_in_words
from endoscope_nodes import names
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import GraphError
from endoscope_nodes.client.graph_parameters import read_parameter, read_parameters, set_parameters
from endoscope_nodes.client.plant_adoption import AdoptedPlants, plant_text

_OF_A_DEVICE = {
    'tare': names.LOAD_CELLS_TARE,
    'register_straight': names.REGISTER_STRAIGHT,
    'reboot': names.MOTOR_REBOOT,
    'watch': names.WATCH_RESTART,
}

_NEXT_WORD_S = 1.5
_HUNG_UP = 128 + signal.SIGHUP
_ANSWERED_S = 2.0


@dataclass(frozen=True)
class GraphReply:
    """What the graph answered."""

    lines: tuple[str, ...]  # in words, the answer itself first
    values: dict[str, Any] = field(default_factory=dict)  # the same for programs


def act(client: GraphClient, args: argparse.Namespace) -> GraphReply:
    """Do what the command line asks for."""
    action, patience_s = args.action, args.timeout
    if action == 'get':
        return _get(client, args.parameter, patience_s)
    if action == 'set':
        return _set(client, args.parameter, args.value, patience_s)
    if action == 'record':
        client.find(patience_s)
        if args.what == 'mark':
            bag = client.mark(args.text, patience_s)
            return GraphReply((f'marked: what led to it goes to {bag}',), {'bag': bag})
        service = names.RECORDER_START if args.what == 'start' else names.RECORDER_STOP
        answer = client.trigger(service, patience_s)
        return GraphReply((f'recording to {answer}' if args.what == 'start' else answer,))
    client.find(patience_s)
    if action in _OF_A_DEVICE:
        return GraphReply((client.trigger(_OF_A_DEVICE[action], patience_s),))
    if action == 'status':
        return GraphReply(*status_of(client, patience_s))
    if action == 'adopt':
        return _adopt(client, args.plant, patience_s)
    if action == 'calibrate':
        return _calibrate(client, patience_s)
    if action == 'home':
        return GraphReply((client.home(patience_s),))
    state = client.ask_and_see(action, patience_s)
    if state == 'ENABLED':
        return GraphReply((f'{state}, {client.session}',), {'session': client.session})
    return GraphReply((state,))


def _adopt(client: GraphClient, file: str | None, patience_s: float) -> GraphReply:
    """Put a plant file into force, or without one the plant before."""
    text = '' if file is None else plant_text(Path(file))
    now = AdoptedPlants(client).adopt(text, patience_s)
    reach = [ranges_in_words(now.ranges, names.JOINTS)] if now.ranges else []
    values = {
        'plant': now.hash,
        'before': now.before,
        'left_out': list(now.left_out),
        'reach': {
            joint: [within.low, within.high]
            for joint, within in zip(names.JOINTS, now.ranges, strict=False)
        },
    }
    return GraphReply((now.answer, *reach), values)


def _calibrate(client: GraphClient, patience_s: float) -> GraphReply:
    try:
        with ProgressLine() as bar:
            result = client.calibrate(bar.show, patience_s)
    except GraphError as error:
        # An aborted calibration reports that the session ended. The supervisor knows why.
        if client.state == 'FAULT' and client.wait_until(lambda: bool(client.why), patience_s):
            raise GraphError(f'{error} ({client.state}: {client.why})') from error
        raise
    return GraphReply(calibration_in_words(result), {'result': result.values})


def _get(client: GraphClient, name: str, patience_s: float) -> GraphReply:
    if '.' not in name.strip('/'):
        return _list(client, name.strip('/'), patience_s)
    parameter = read_parameter(client, name, patience_s)
    return GraphReply(
        (f'{name} = {_in_words(parameter.value)}', f'    {parameter.description}'),
        {
            'node': parameter.node,
            'parameter': parameter.name,
            'value': _of_json(parameter.value),
            'description': parameter.description,
        },
    )


def _list(client: GraphClient, node: str, patience_s: float) -> GraphReply:
    parameters = read_parameters(client, node, patience_s)
    width = max(len(parameter.name) for parameter in parameters)
    return GraphReply(
        tuple(
            f'{node}.{p.name:<{width}} = {_in_words(p.value)}    {p.description}'
            for p in parameters
        ),
        {
            'node': node,
            'parameters': {
                p.name: {'value': _of_json(p.value), 'description': p.description}
                for p in parameters
            },
        },
    )


def _set(client: GraphClient, name: str, text: str, patience_s: float) -> GraphReply:
    parameter = read_parameter(client, name, patience_s)
    node, value = parameter.node, parameter.parse(text)
    set_parameters(client, node, {parameter.name: value}, patience_s)
    now = read_parameter(client, name, patience_s).value
    # A node reports an error with the value within a second.
    client.hear()
    before_ns = client.heard_ns.get(node, 0)
    client.wait_until(lambda: client.heard_ns.get(node, 0) > before_ns, _NEXT_WORD_S)
    errors = {
        part: health.message
        for part, health in client.health.items()
        if part.partition(':')[0] == node and health.level
    }
    return GraphReply(
        (
            f'{name} = {_in_words(now)}, was {_in_words(parameter.value)}',
            *(f'    {part}: {message}' for part, message in errors.items()),
        ),
        {
            'node': node,
            'parameter': parameter.name,
            'value': _of_json(now),
            'was': _of_json(parameter.value),
            'troubles': errors,
        },
    )


def _of_json(value: Any) -> Any:
    """JSON knows neither infinity nor NaN."""
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _in_words(value: Any) -> str:
    return value or "''" if isinstance(value, str) else json.dumps(_of_json(value))


@contextmanager
def paused_when_interrupted(client: GraphClient, moving: bool) -> Iterator[None]:
    """Pause the graph if SIGINT, SIGTERM or SIGHUP ends the block during a motion."""

    def unwind(number: int, frame: FrameType | None) -> None:
        raise SystemExit(_HUNG_UP)

    # Whoever starts a program by `nohup` wants it to outlive the terminal.
    ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    previous = signal.SIG_IGN if ignored else signal.signal(signal.SIGHUP, unwind)
    try:
        yield
    except (KeyboardInterrupt, SystemExit):
        if moving:
            client.order('pause')
            client.wait_until(lambda: client.state != 'ENABLED', _ANSWERED_S)
            print(f'interrupted: the graph is {client.state or "silent"}', file=sys.stderr)
        raise
    finally:
        signal.signal(signal.SIGHUP, previous)
