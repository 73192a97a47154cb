"""`endoscope bench NAME`: measure a figure of the documentation on this machine."""

import argparse
import importlib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from endoscope_bringup.subcommands import COUNT, seed, within

Option = tuple[str, dict[str, Any]]
"""Name of an option, and its arguments for argparse."""


@dataclass(frozen=True)
class Bench:
    """A benchmark: `run(args)` of its module measures, prints, and returns the exit status."""

    module: str  # in this package; imported when the benchmark is chosen
    help: str
    description: str
    options: tuple[Option, ...]


def seeds(text: str) -> range:
    """Read a range of seeds, `A-B` inclusive, or one seed; ArgumentTypeError otherwise."""
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
    return _count('--jobs', 'parallel jobs', default)


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
        'tick rate, latency and CPU time of the node graph',
        'Runs all nodes on the simulated slave: in one process in real time with a recorder; in '
        'lock-step at full speed; and in one process for each node, at decreasing rates until a '
        'rate is sustained. With --recorder, sends 5, 10 and 20 thousand messages/s to a separate '
        'recorder process instead, and reads the bag. Exits 1 if a target is missed.',
        (
            _seconds(60.0, 'length of the run in one process, and of each run of --recorder'),
            _seconds(10.0, 'length of each run in many processes, 0 for none', '--process-seconds'),
            _flag('--recorder', 'measure the rate recorded without loss, and its CPU time'),
            _seconds(
                0.0, 'instead, let participants join and leave for this long at 1 kHz', '--soak'
            ),
        ),
    ),
    'stick': Bench(
        'stick',
        'latency of velocities that another process commands',
        'Runs all nodes on the simulated slave in one process in real time. Another process '
        'commands velocities on slave/servo_jv that reverse every 0.2 s. Measures the time from '
        'its sending a reversal until the tick in which the motor driver obeys the first command '
        'made of it. Exits 1 if the 99th percentile is 3 ms or more.',
        (_seconds(60.0, 'length of the measurement'),),
    ),
    'console': Bench(
        'console.console',
        'time until the slave stops after an event on the page',
        'Starts `endoscope console` with its graph and a real Chromium in which a key is held. '
        'Triggers events on the page, such as a closed tab, and prints the stopping times; then '
        'prints the latency of an input. Exits 1 if anything moves before the key is pressed '
        'again.',
        (
            _count('--repetitions', 'repetitions of each event', 30),
            _option('--only', 'events to trigger; `all` for all', nargs='+', metavar='EVENT'),
            _count('--inputs', 'inputs whose latency is measured', 30),
            _flag('--real-time', 'run the graph on the wall clock, with its deadlines'),
        ),
    ),
    'faults': Bench(
        'faults.faults',
        'fault injection: failing nodes and motors, competing publishers',
        'Runs the graph on the simulated slave with one process for each node, injects one fault '
        'after the other at random instants of the motion, enables the slave again, and prints a '
        'table. Exits 1 if the slave moves without an enable, a step exceeds the bound of the '
        'shaper, or an enable fails. With --motors, injects faults of servos, their bus and the '
        'master on emulated servos instead; exits 1 if the slave does not reach the required '
        'state.',
        (
            _count('--repetitions', 'repetitions of each fault', 100),
            _count('--rate', 'ticks per second', 500),
            _flag('--composed', 'run all nodes in one process'),
            _flag('--motors', 'inject faults of the motors, once each'),
            _seed('seed of all random draws'),
            _only('fault'),
        ),
    ),
    'concealed': Bench(
        'concealed.trial',
        'blind benchmark: explain rigs with injected effects',
        'Blind benchmark: injected effects. Draws rigs with injected effects, explains a recording '
        'of each, and prints a line for each case and a table. Every seed is one case of every '
        'stratum. Seeds 1 to 99 are for development; of other seeds, first runs are published. '
        'With --json, rows are stored as cases finish, and cases in the file are not explained '
        'again, so that a long run can be resumed. With --derive, derives the numbers of '
        'endoscope_explain/criteria.py from the cases, and prints the effect of halving and '
        'doubling each. With --page, draws which names are confounded with which. Exits 1 if a '
        'case cannot be explained, or differs from --against.',
        (
            _option('--stratum', 'kinds of cases (default: all)', nargs='+', metavar='NAME'),
            _seeds('seeds of the cases (default: 1-3)'),
            _jobs(),
            _file('--json', 'file for all rows'),
            _file(
                '--against', 'rows of an earlier run: explain the same cases and print differences'
            ),
            _flag('--derive', 'derive the numbers by which explanations are judged'),
            _file('--write', 'Python module to write the derived numbers to'),
            _file('--page', 'HTML page to write with what is confounded with what'),
        ),
    ),
    'investigate': Bench(
        'investigate',
        'blind benchmark of `endoscope investigate` on rigs with injected effects',
        'Draws rigs with injected effects, of the kernel and of a simulator that shares no code '
        'with it, every fourth with two effects. Explains each by the loop of `endoscope '
        'investigate`, whose first motion is the calibration, and by the commissioning motion '
        'alone. Prints a line for each explanation, and a table. Seeds 1 to 99 '
        'are for development; of other seeds, first runs are published. With --json, rows are '
        'stored as they are there, and rigs in the file are skipped. Exits 1 if a rig cannot be '
        'explained.',
        (
            _seeds('seeds of the rigs (default: 1-4)', last=4),
            _jobs(),
            _file('--json', 'file for all rows'),
            _minutes('--minutes', 'time after which no rig or motion is started', 1440.0),
            _minutes('--rig-minutes', 'time after which a rig plays no further motion', 60.0),
        ),
    ),
    'mistakes': Bench(
        'mistakes.mistake',
        'audit recordings with injected mistakes of units, signs and signals',
        'Draws a recording with each kind of mistake for every seed, and correct recordings. '
        'Prints mistakes that the audit does not report correctly, false alarms on correct '
        'recordings, and a table. Seeds 1 to 99 are for development; of other seeds, first runs '
        'are published.',
        (
            _seeds('seeds of recordings with mistakes (1)', last=1),
            _seeds('seeds of correct recordings (1-10)', '--sound', last=10),
            _jobs(),
        ),
    ),
    'watch': Bench(
        'watch.trial',
        'change detection: rigs that change while they move',
        'Change detection. Changes a moving rig in each of ten ways for every seed, and prints how '
        'many changes are reported within 10 s of motion, and at the right stage; then moves rigs '
        'that do not change, 10 min each, and prints the false alarms. Seeds 1 to 999 are for '
        'development; of other seeds, first runs are published. With --cost, runs all nodes with '
        'and without the watch instead, and exits 1 if it costs more than 10 % of a core.',
        (
            _seeds('seeds of rigs that change (1-3)'),
            _seeds('seeds of rigs that do not change (1-6)', '--nominal', last=6),
            _only('change'),
            _flag('--derive', 'derive the thresholds from rigs that do not change'),
            _file('--write', 'Python module to write the derived thresholds to'),
            _file('--json', 'file for all rows; cases in it are skipped'),
            _seconds(86400.0, 'stop after this time in s and print what is finished', '--within'),
            _jobs(),
            _flag('--cost', 'measure CPU time and rate of the graph'),
        ),
    ),
    'touch': Bench(
        'touch.trial',
        'force at the tip: rigs that touch an obstacle in teleoperation',
        'Force at the tip. Draws rigs of two simulators, identifies each from a motion in free '
        'space, and teleoperates it against an obstacle of 0.02 to 2 N/mm; prints the error of '
        'the force beyond the bound that friction sets, over the largest force, how often the '
        'stated bounds hold the true force, and how many contacts of twice the visible force are '
        'reported within 0.3 s. Then teleoperates rigs in free space, 10 min each, and prints the '
        'false alarms. With --push, has a hand push each rig into its obstacle and not let go '
        'instead, through the stream of commands of the compensator, and prints the largest force '
        'with the guard of the tip beside that without. Seeds 1 to 999 are for development.',
        (
            _seeds('seeds of rigs that touch something (1-3)'),
            _seeds('seeds of rigs in free space (1-2)', '--free', last=2),
            _flag('--visible', 'print instead what is seen by the bend of tube and tip'),
            _flag('--derive', 'print instead what free motion leaves over rigs'),
            _option('--push', 'seeds of rigs that are pushed', type=seeds, metavar='A-B'),
            _file('--json', 'file for all rows; cases in it are skipped'),
            _jobs(),
        ),
    ),
    'validity': Bench(
        'validity',
        'how long a calibration stays valid',
        'Calibrates rigs in tubes that no fit has used, and changes wires, sheaths, tube and load '
        'as four hours of work do. At several times, prints the result of a new calibration, the '
        'tracking error of the tip with the first and the new calibration, and whether a watch '
        'reports the change. Seeds 1 to 100 are for development.',
        (
            _seeds('seeds of the tubes (1-3)'),
            _only('cause'),
            _file('--json', 'file for all rows; cases in it are skipped'),
            _file('--picture', 'SVG file for a plot of the errors'),
            _jobs(),
        ),
    ),
    'real': Bench(
        'real.tables',
        'explain real recordings of a flexible endoscope by one plant',
        'Fits five tubes together on 1.3 cycles, searches for missing physics, predicts the rest, '
        'and applies the result to the rig in other states. The recordings are not part of this '
        'project: put optimization/selected and operation/optimizer_input of '
        'nhoyh/hysteresis_compensation_ROS into one folder.',
        (
            _option('folder', 'folder of the recordings', type=Path),
            _file('--out', 'page to write (real.html)', Path('real.html')),
            _flag(
                '--thorough',
                'also explain each tube alone, withhold the name found, and remove each component',
            ),
            _jobs(),
        ),
    ),
    'papers': Bench(
        'papers.papers',
        'the tables of the two papers, with our figures',
        'Measures the figures of the two papers on tube configurations that no fit has used, and '
        'prints both: tension_by_shape, classifiers, nearest_class, colon_shapes, compensators, '
        'reach, changing_tube, calibration_time, real_sizes, real_recordings. Two more tables are '
        'printed on request (--only): calibrations with load cells that drift, clip, stick or are '
        'unplugged (load_cells), and with cells that are read slowly (reading_rates). Exits 1 if '
        'an aim is missed.',
        (
            _seed('seed of tubes, rigs and noise'),
            _count('--tubes', 'tube configurations per row; for load_cells, per class', 5),
            _only('table'),
            _option(
                '--motion',
                'motion of load_cells and reading_rates: sinusoid or brief (sinusoid)',
                default='sinusoid',
            ),
            _file(
                '--weights',
                'classifier weights for load_cells and reading_rates, from `endoscope train` '
                '(those shipped)',
            ),
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
