"""`endoscope operate`: sends a request to a running graph and prints its answer."""

import argparse

from endoscope_bringup.subcommands import add_graph_options

MOVING = ('enable', 'resume', 'home', 'calibrate')
DONE, REFUSED = 0, 1

_ACTIONS = {
    'status': 'state and why, session, health of every node, model, last calibration, recorder, '
    'console',
    'enable': 'let the slave move: opens a motion session; waits for ENABLED',
    'disable': 'end the session and switch the motors off, in any state; waits for DISABLED',
    'home': 'move the motors back to zero; waits until they are there',
    'pause': 'end the session and hold the slave where it is; waits for PAUSED',
    'resume': 'continue after a pause; waits for ENABLED',
    'calibrate': 'find the hysteresis class of the tube by a motion of some 10 s; waits for the '
    'result',
    'adopt': 'compensate by an improved plant, as `endoscope explain` writes it: at rest, in the '
    'session that is open; --undo: by the plant before',
    'tare': 'set the mean tension of the last second as zero; wires slack, shafts at rest',
    'register_straight': "register the tracker's pose of the last second as straight",
    'reboot': 'restart the servos without torque; not while the slave is ENABLED',
    'watch': 'restart change detection: clear its alarms and learn the rig again',
    'set': 'set a parameter of a node',
    'get': "print a parameter's value, or all parameters of a node with values and ranges",
    'record': 'start or stop a recording; or mark this moment, with TEXT: the preceding seconds '
    'and the following 2 s become a bag',
}
_INTERRUPTED = (
    'Ctrl-C, SIGTERM or closing the terminal pauses the graph: the slave holds its position, and '
    'no motion continues unattended; `resume` continues. Only after a kill -9 of this command does '
    'the motion run to its end in the graph.'
)


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `operate`."""
    parser = subparsers.add_parser(
        'operate',
        help='enable, calibrate, set parameters, record on a running graph',
        description='Sends a request to a running graph and prints its answer in a line. Exits 0 '
        'when it is done, 1 when the graph refuses it or does not answer in time, 2 for wrong '
        'usage, 130 when interrupted.',
    )
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument('--json', action='store_true', help='print one JSON object instead')
    add_graph_options(common)
    actions = parser.add_subparsers(dest='action', metavar='ACTION', required=True)
    for name, words in _ACTIONS.items():
        more = f' {_INTERRUPTED}' if name in MOVING else ''
        action = actions.add_parser(
            name, parents=[common], help=words, description=f'{words[0].upper()}{words[1:]}.{more}'
        )
        if name in ('set', 'get'):
            action.add_argument(
                'parameter',
                metavar='NODE.PARAMETER' if name == 'set' else 'NODE[.PARAMETER]',
                help='for example compensator.mode',
            )
        if name == 'set':
            action.add_argument(
                'value', metavar='VALUE', help='of its type: true, 0.5, physical, [bend_x, bend_y]'
            )
        if name == 'adopt':
            which = action.add_mutually_exclusive_group(required=True)
            which.add_argument('plant', nargs='?', metavar='P.yaml', help='the improved plant')
            which.add_argument(
                '--undo', action='store_true', help='go back to what was in force before'
            )
        if name == 'record':
            action.add_argument('what', choices=('start', 'stop', 'mark'))
            action.add_argument(
                'text', metavar='TEXT', nargs='?', default='', help='why this moment is marked'
            )


def run(args: argparse.Namespace) -> int:
    """Ask; return 1 if it was refused or not reached in time."""
    import json
    import sys
    from functools import partial

    from endoscope_bringup.operating.actions import act, paused_when_interrupted
    from endoscope_core.errors import InputError, printable
    from endoscope_nodes.client.graph_client import joined_graph
    from endoscope_nodes.client.graph_listener import GraphError
    from endoscope_nodes.client.plant_adoption import RefusedAdoptionError

    if getattr(args, 'text', '') and args.what != 'mark':
        raise InputError(f'record {args.what} takes no text; record mark does')
    name = ' '.join(filter(None, (args.action, getattr(args, 'what', ''))))
    try:
        with (
            joined_graph('operate', args.namespace) as client,
            paused_when_interrupted(client, args.action in MOVING),
        ):
            client.report = partial(print, file=sys.stderr, flush=True)
            reply = act(client, args)
    except GraphError as error:
        if args.json:
            code = {'code': error.code} if isinstance(error, RefusedAdoptionError) else {}
            print(json.dumps({'action': name, 'done': False, 'answer': str(error)} | code))
        else:
            print(f'{name}: {error}', file=sys.stderr)
        return REFUSED
    if args.json:
        print(json.dumps({'action': name, 'done': True, 'answer': reply.lines[0]} | reply.values))
    else:
        for line in reply.lines:
            print(printable(line))
    return DONE
