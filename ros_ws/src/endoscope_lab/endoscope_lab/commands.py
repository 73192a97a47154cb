"""`endoscope bench NAME`: measures a figure of the documentation on this machine."""

import argparse
import importlib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from endoscope_bringup.subcommands import COUNT, seed, within

Option = tuple[str, dict[str, Any]]
"""Its name, and what argparse has to know of it."""


@dataclass(frozen=True)
class Bench:
    """A bench: `run(args)` of its module measures, prints, and returns the exit status."""

    module: str  # in this package; imported once the bench is chosen
    help: str
    description: str
    options: tuple[Option, ...]


def seeds(text: str) -> range:
    """Read a range of seeds, `A-B` with both ends, or one; ArgumentTypeError if it is none."""
    found = re.fullmatch(r'(\d+)(?:-(\d+))?', text)
    if not found or int(found[2] or found[1]) < int(found[1]):
        raise argparse.ArgumentTypeError(f'{text!r} are not seeds: give 1-20, or 7')
    return range(seed(found[1]), seed(found[2] or found[1]) + 1)


def _option(name: str, what: str, **how: Any) -> Option:
    return name, {'help': what, **how}


def _seeds(what: str, name: str = '--seeds', last: int = 3) -> Option:
    return _option(name, what, type=seeds, default=range(1, last + 1), metavar='A-B')


def _seed(what: str, default: int = 1) -> Option:
    return _option('--seed', f'{what} ({default})', type=seed, default=default)


def _count(name: str, what: str, default: int) -> Option:
    return _option(name, f'{what} ({default})', type=COUNT, default=default, metavar='N')


def _jobs(default: int = 1) -> Option:
    return _count('--jobs', 'side by side', default)


def _seconds(default: float, what: str, name: str = '--seconds') -> Option:
    kind = within(0.0, 86400.0, float)
    return _option(name, f'{what} (default: {default:g})', type=kind, default=default)


def _minutes(name: str, what: str, default: float) -> Option:
    kind = within(0.0, 1e5, float)
    return _option(name, f'{what} ({default:g})', type=kind, default=default, metavar='M')


def _only(what: str) -> Option:
    return _option('--only', f'{what}s to try (default: all)', nargs='+', metavar=what.upper())


def _file(name: str, what: str, default: Path | None = None) -> Option:
    return _option(name, what, type=Path, default=default, metavar='FILE')


def _flag(name: str, what: str) -> Option:
    return _option(name, what, action='store_true')


BENCHES: dict[str, Bench] = {
    'graph': Bench(
        'graph',
        'ticks, latency and CPU time of the node graph',
        'Runs all nodes on the simulated slave: in one process in real time, with a recorder; in '
        'lock-step as fast as it goes; and each in a process of its own at falling rates until one '
        'is carried. With --recorder, sends 5, 10 and 20 thousand messages/s to a recorder in a '
        'process of its own instead, and looks into the bag. Exits 1 where a target is missed.',
        (
            _seconds(60.0, 'length of the run in one process, and of one of --recorder'),
            _seconds(10.0, 'length of each run in many processes, 0 for none', '--process-seconds'),
            _flag('--recorder', 'what the recorder takes without loss, and its CPU time'),
            _seconds(0.0, 'instead, let participants come and go for so long at 1 kHz', '--soak'),
        ),
    ),
    'console': Bench(
        'console.console',
        'how soon the slave stops whatever happens to the page',
        'Starts `endoscope console` with its graph and a real Chromium in which a key is held, '
        'lets one thing after the other happen to the page, and prints a table; then the latency '
        'of an input. Exits 1 where something moved without a new grip.',
        (
            _count('--repetitions', 'of each event', 30),
            _option('--only', 'events to try; `all` for all', nargs='+', metavar='EVENT'),
            _count('--inputs', 'inputs whose latency is taken', 30),
            _flag('--real-time', 'run the graph by the wall clock, with its deadlines'),
        ),
    ),
    'faults': Bench(
        'faults.faults',
        'what the slave does when a node, a motor or the master fails, or a second sender appears',
        'Runs the graph on the simulated slave, each node a process, breaks one thing after the '
        'other at random instants of the motion, enables anew, and prints a table. Exits 1 where '
        'the slave moved without an enable, a step was beyond the bound of the shaper, or an '
        'enable did not work. With --motors, breaks servos, their line and the master on emulated '
        'servos instead; exits 1 where the slave does not end as it must.',
        (
            _count('--repetitions', 'of each fault', 100),
            _count('--rate', 'ticks/s', 500),
            _flag('--composed', 'all nodes in one process'),
            _flag('--motors', 'faults of the motors, once each'),
            _seed('of all chance'),
            _only('fault'),
        ),
    ),
    'concealed': Bench(
        'concealed.trial',
        'explain rigs that are drawn with something concealed in them',
        'Draws rigs with something concealed, explains a recording of each, and prints a line for '
        'each case and a table. Every seed is a case of every stratum. Seeds from 1 to 99 are for '
        'development; of others, first runs are reported. With --json each case is kept once it is '
        'known, and what the file has is not explained again: a long run goes on where it was '
        'stopped. With --derive, derives the numbers of endoscope_explain/criteria.py from the '
        'cases, and prints what half and double of each would do. Exits 1 if a case could not be '
        'explained, or differs from --against.',
        (
            _option('--stratum', 'kinds of cases (default: all)', nargs='+', metavar='NAME'),
            _seeds('of the cases (default: 1-3)'),
            _jobs(),
            _file('--json', 'file for all rows'),
            _file(
                '--against', 'rows of an earlier run: explain the same cases, and say what differs'
            ),
            _flag('--derive', 'derive the numbers by which explanations are judged'),
            _file('--write', 'module for them'),
        ),
    ),
    'investigate': Bench(
        'investigate',
        'ask concealed rigs for motions until they are explained',
        'Draws rigs with something concealed, of the kernel and of a simulator that shares nothing '
        'with it, every fourth with two effects. Each is explained by the commissioning motion, by '
        'the loop of `endoscope investigate`, and by one fixed motion as long as all of the loop '
        'together. Prints a line for each rig and way, and a table. Seeds from 1 to 99 are for '
        'development; of others, first runs are reported. With --json each rig is kept once it is '
        'known, and what the file has is not done again. Exits 1 if a rig could not be explained.',
        (
            _seeds('of the rigs (default: 1-4)', last=4),
            _jobs(),
            _file('--json', 'file for all rows'),
            _minutes('--minutes', 'after which no rig is begun, and no motion played', 1440.0),
            _minutes('--rig-minutes', 'after which no further motion of a rig is played', 60.0),
        ),
    ),
    'mistakes': Bench(
        'mistakes.mistake',
        'audit recordings in which something was taken wrongly',
        'Draws a recording of each kind of mistake for every seed and prints which were not '
        'reported correctly; then correct recordings, and prints what was reported of them. Seeds '
        'from 1 to 99 are for development; of others, first runs are reported.',
        (
            _seeds('of mistakes (1)', last=1),
            _seeds('of correct recordings (1-10)', '--sound', last=10),
            _jobs(),
        ),
    ),
    'watch': Bench(
        'watch.trial',
        'whether a rig that becomes different while it moves is noticed',
        'Changes a moving rig in each of ten ways for every seed, and prints how many changes were '
        'told within 10 s of motion, and at the right stage; then moves rigs that stay as they '
        'are, 10 min each, and prints the false alarms. Seeds from 1 to 999 are for development; '
        'of others, first runs are reported. With --cost, runs all nodes with and without the '
        'watch instead, and exits 1 where watching costs more than 10 % of a core.',
        (
            _seeds('of the changes (1-3)'),
            _seeds('of rigs that stay as they are (1-6)', '--nominal', last=6),
            _only('change'),
            _flag('--derive', 'derive the thresholds from these'),
            _file('--write', 'module for them'),
            _file('--json', 'file for all rows; what is in it is not done again'),
            _seconds(86400.0, 'take what there is after so long, in s', '--within'),
            _jobs(),
            _flag('--cost', 'CPU time and pace of the graph'),
        ),
    ),
    'validity': Bench(
        'validity',
        'how long a calibration stays good',
        'Calibrates rigs in tubes that nothing was fitted on, lets wires, sheaths, tube and load '
        'become what they become in four hours of work, and prints from time to time what another '
        'calibration says, how the tip tracks by the first calibration and by the new one, and '
        'whether a watch tells that the rig has changed. Seeds from 1 to 100 are for development.',
        (
            _seeds('of the tubes (1-3)'),
            _only('cause'),
            _file('--json', 'file for all rows; what is in it is not done again'),
            _file('--picture', 'SVG file for a picture of it'),
            _jobs(),
        ),
    ),
    'real': Bench(
        'real.tables',
        'explain real recordings of a flexible endoscope by one physics',
        'Fits five tubes together on 1.3 cycles and searches what they lack, predicts the rest, '
        'and carries what was found to the rig in other states. The recordings are '
        'no part of this project: optimization/selected and operation/optimizer_input of '
        'nhoyh/hysteresis_compensation_ROS, in one folder.',
        (
            _option('folder', 'folder of the recordings', type=Path),
            _file('--out', 'page to write (real.html)', Path('real.html')),
            _flag(
                '--thorough',
                'each tube alone as well, all with the name withheld, and each piece taken out',
            ),
            _jobs(),
        ),
    ),
    'papers': Bench(
        'papers.papers',
        "the papers' tables beside ours",
        'Measures what the two papers report, on tube configurations that nothing was fitted on, '
        'and prints it beside their figures: tension_by_shape, classifiers, nearest_class, '
        'colon_shapes, compensators, reach, changing_tube, calibration_time, real_sizes, '
        'real_recordings. Where they are asked for by --only, two tables more say how a '
        'calibration fares with load cells that drift, clip, stick or are unplugged (load_cells), '
        'and with cells that are read slowly (reading_rates). Exits 1 if an aim is missed.',
        (
            _seed('chooses tubes, rigs and noise'),
            _count('--tubes', 'tube configurations of each row; of load cells, of each class', 5),
            _only('table'),
            _option('--motion', 'of load cells: sinusoid or brief (sinusoid)', default='sinusoid'),
            _file('--weights', 'of load cells: from `endoscope train` (those of the product)'),
        ),
    ),
}


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `bench` with one subparser for each of `BENCHES`."""
    parser = subparsers.add_parser(
        'bench', help='measure a figure of the documentation on this machine'
    )
    benches = parser.add_subparsers(dest='bench', metavar='BENCH', required=True)
    for name, bench in BENCHES.items():
        one = benches.add_parser(name, help=bench.help, description=bench.description)
        for option, how in bench.options:
            one.add_argument(option, **how)


def run(args: argparse.Namespace) -> int:
    """Run the chosen bench and return its exit status."""
    module = importlib.import_module(f'{__package__}.{BENCHES[args.bench].module}')
    return int(module.run(args))
