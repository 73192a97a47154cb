"""`endoscope investigate`: moves a rig, explains it, and plays discriminating experiments."""

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from endoscope_bringup.subcommands import add_options, within
from endoscope_core.errors import EndoscopeError, NotPlayedError, RigStoppedError
from endoscope_explain.options import Options

if TYPE_CHECKING:
    from endoscope_core.rig import Rig
    from endoscope_explain.investigation.motions import RigMotion
    from endoscope_nodes.client.graph_client import GraphClient

LOOKS_S = 3.0
"""For a graph that runs."""


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `investigate`."""
    parser = subparsers.add_parser(
        'investigate',
        help='move a rig, explain it, and play motions that discriminate between the alternatives',
        description='Plays the calibration sinusoid on a running graph and explains the recording '
        'with the plant P.yaml. As long as an effect has alternatives, plays the safe motion that '
        'discriminates best, and explains all recordings together; where no short one does, the '
        'commissioning motion. Writes bags, log.json, '
        'log.md, index.html and the improved plant, plant.yaml, to DIR meanwhile. The same command '
        'on the same DIR continues an interrupted investigation. Each motion needs consent, has '
        'its own motion session, and is refused beyond the limits of rig.yaml. Ctrl-C pauses the '
        'graph. Exits 0 at the end, 1 if the rig or a person stopped it, 130 when interrupted.',
    )
    parser.add_argument(
        '--plant', type=Path, required=True, metavar='P.yaml', help='plant of the rig'
    )
    parser.add_argument(
        '--out',
        type=Path,
        required=True,
        metavar='DIR',
        help='new or empty folder, or that of an investigation to continue',
    )
    parser.add_argument(
        '--experiments',
        type=within(0, 100, int),
        default=4,
        metavar='N',
        help='largest number of motions after the calibration (default 4)',
    )
    parser.add_argument(
        '--attended',
        action='store_true',
        help='an operator stands at the rig with a hand on its emergency stop: motions need no '
        'individual consent',
    )
    parser.add_argument(
        '--lines',
        action='store_true',
        help='JSON-lines protocol on stdin/stdout: another program plays the motions, as endoscope '
        'console does',
    )
    parser.add_argument(
        '--simulate',
        type=Path,
        metavar='SLAVE.yaml',
        help='start a simulated graph with this plant, in simulated time',
    )
    parser.add_argument(
        '--rig', type=Path, metavar='rig.yaml', help='the rig and its limits (default: as shipped)'
    )
    parser.add_argument(
        '--namespace',
        default='endoscope',
        help='namespace of the running graph (default: %(default)s)',
    )
    add_options(parser, Options, 'jobs')


def run(args: argparse.Namespace) -> int:
    """Investigate; return 1 if the rig or a person stopped it."""
    from functools import partial

    from endoscope_bringup.operating.actions import paused_when_interrupted
    from endoscope_core.investigation_folder import PAGE, held
    from endoscope_core.rig import load_rig
    from endoscope_explain.investigation import index_page
    from endoscope_explain.investigation.investigation import (
        Investigation,
        explain_together,
        investigate,
    )
    from endoscope_explain.investigation.log import Log, Stop, begun
    from endoscope_nodes.client.motion_player import MotionPlayer

    if not (args.attended or args.lines or sys.stdin.isatty()):
        raise EndoscopeError('nobody can be asked for each motion here: give --attended, or a tty')
    rig = load_rig(args.rig)
    of = Investigation(args.out, args.plant, rig, args.experiments, args.jobs)
    begun(of.folder, of.plant_file)
    step = partial(print, file=sys.stderr, flush=True)

    def investigated(player: MotionPlayer | _MotionsByLines, say: Callable[[str], None]) -> Log:
        return investigate(
            of,
            player.play,
            lambda bags, known: explain_together(bags, known, of, step),
            track=player.play,
            page=lambda log: index_page.page(log, of.folder),
            report=say,
        )

    with held(of.folder):
        if args.lines:
            lines = _MotionsByLines()
            log = investigated(lines, lines.say)
        else:
            say = partial(print, flush=True)
            consent = (lambda words: True) if args.attended else _asked
            with _graph(args, rig) as client, paused_when_interrupted(client, moving=True):
                log = investigated(MotionPlayer(client, consent), say)
            say(f'Page: {of.folder / PAGE}')
    return 1 if log.stopped in (Stop.FAULT, Stop.INTERRUPTED) else 0


def _asked(words: str) -> bool:
    return input(f'{words} [y/N] ').strip().lower() in ('y', 'yes')


@contextmanager
def _graph(args: argparse.Namespace, rig: 'Rig') -> Iterator['GraphClient']:
    """The running graph, or a simulated one if none runs or --simulate is given."""
    from endoscope_nodes.client.graph_client import joined_graph
    from endoscope_nodes.client.graph_listener import GraphError

    slave = args.simulate
    if slave is None:
        with joined_graph('investigate', args.namespace) as client:
            try:
                client.find(LOOKS_S)
            except GraphError as error:
                if client.nodes():
                    raise
                plant = rig.simulation.plant
                print(f'{error}; this one is on a slave simulated by {plant or "nominal numbers"}')
                slave = Path(plant) if plant else None
            else:
                yield client
                return
    from endoscope_bringup.demo.live_graph import NODES, LiveGraph
    from endoscope_nodes.nodes.recorder import RecorderNode

    overrides: dict[str, dict[str, object]] = {
        'motor_driver': {'seed': rig.simulation.seed},
    }
    if slave is not None:
        overrides['motor_driver']['plant_file'] = str(slave)
    nodes = (*NODES, RecorderNode)
    with LiveGraph(None, lock_step=True, overrides=overrides, rig=rig, nodes=nodes) as graph:
        yield graph.client


class _MotionsByLines:
    """Another program plays the motions: a request and its outcome are each a line of JSON."""

    def say(self, sentence: str) -> None:
        """Write a sentence of the log."""
        self._write({'say': sentence})

    def play(self, motion: 'RigMotion', file: Path, bag: Path, plant: Path | None = None) -> None:
        """Have a motion played and recorded; see `endoscope_nodes.client.motion_player`."""
        asked = {
            'words': motion.words,
            'why': motion.why,
            'duration': motion.duration,
            'file': str(file.absolute()),
            'bag': str(bag.absolute()),
            'plant': '' if plant is None else str(plant.absolute()),
        }
        self._write({'play': asked})
        line = sys.stdin.readline()
        if not line:
            raise NotPlayedError('the program that plays the motions has ended')
        answer = json.loads(line)
        became, why = answer['became'], answer['why']
        if became == 'not_played':
            raise NotPlayedError(why)
        if became == 'rig_stopped':
            raise RigStoppedError(why)
        if became != 'played':
            raise EndoscopeError(why)

    def _write(self, message: dict[str, object]) -> None:
        print(json.dumps(message), flush=True)
