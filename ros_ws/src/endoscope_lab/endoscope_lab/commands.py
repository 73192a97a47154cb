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


def _file(name: str, what: str) -> Option:
    return _option(name, what, type=Path, metavar='FILE')


def _strata(*names: str) -> Option:
    what = f'kinds of cases (default: {" ".join(names or ("all",))})'
    return _option('--stratum', what, nargs='+', metavar='NAME', default=names)


BENCHES: dict[str, Bench] = {
    'graph': Bench(
        'graph',
        'ticks, latency and CPU time of the node graph',
        'Runs all nodes on the simulated slave: in one process in real time, with a recorder; in '
        'lock-step as fast as it goes; and each in a process of its own at falling rates until one '
        'is carried. Exits 1 where a target is missed.',
        (
            _seconds(60.0, 'length of the run in one process'),
            _seconds(10.0, 'length of each run in many processes, 0 for none', '--process-seconds'),
        ),
    ),
    'kept': Bench(
        'kept_messages',
        'what it costs the recorder to keep the last 20 s in memory',
        'Runs all nodes in one process in lock-step, 1000 ticks a second, with a recorder that '
        'hears nothing, hears all, keeps the last 20 s, records, and does both, and prints the '
        'least CPU time of a second of motion. Exits 1 where keeping costs more than 3 % of a '
        'core.',
        (
            _seconds(20.0, 'of simulated motion of each run'),
            _option('--rounds', 'of the five runs (default: 3)', type=COUNT, default=3),
        ),
    ),
    'console': Bench(
        'console.console',
        'how soon the slave stops whatever happens to the page, and what the console costs',
        'Starts `endoscope console` with its graph and a real Chromium in which a key is held, '
        'lets one thing after the other happen to the page, and prints a table; then the latency '
        'of an input, CPU time of the server, ticks of the graph with viewers and frames of the '
        'page. Exits 1 where something moved without a new grip.',
        (
            _option('--repetitions', 'of each event (default: 30)', type=COUNT, default=30),
            _option('--only', 'events to try; `all` for all', nargs='+', metavar='EVENT'),
            _option(
                '--inputs', 'inputs whose latency is taken (default: 30)', type=COUNT, default=30
            ),
            _seconds(20.0, 'of each figure of cost'),
            _option(
                '--real-time',
                'run the graph by the wall clock, with its deadlines',
                action='store_true',
            ),
        ),
    ),
    'pauses': Bench(
        'pauses',
        'rest within a motion session, then move',
        'Draws for every seed a rest from 1 s to the longest, evenly on a logarithmic scale, and '
        'what is asked for after it: a way home, a played motion, the handle or a calibration. The '
        'simulated graph goes through it in lock-step; within 0.5 s of the first command the '
        'motors have to turn, or the graph has to say why they do not.',
        (
            _seeds('of the rests (1-3)'),
            _option(
                '--longest',
                'longest rest in s (3600)',
                type=within(1.0, 1e6, float),
                default=3600.0,
                metavar='S',
            ),
            _jobs(),
        ),
    ),
    'busy': Bench(
        'console.busy',
        'the first session and the console beside busy programs',
        'Starts busy loops, then again and again the session of README in a shell, and the console '
        'with a real Chromium: take the controls, enable, calibrate, move, go home. Then the '
        'simulated slave plays a motion for a while beside Chromium and two busy loops, recorded. '
        'Exits 1 where a step failed, a fault came or a message was lost.',
        (
            _count('--n', 'of each', 20),
            _option('--loops', 'busy loops (7)', type=within(0, 64, int), default=7, metavar='N'),
            _option(
                '--minutes',
                'of the long motion (30)',
                type=within(0.0, 1440.0, float),
                default=30.0,
                metavar='M',
            ),
        ),
    ),
    'recorder': Bench(
        'recorder',
        'messages per second that the recorder takes without loss, and its CPU time',
        'Sends JointStates of two joints on twenty topics to a recorder in a process of its own, '
        'at 5, 10 and 20 thousand messages/s, and looks into the bag. Exits 1 where the target '
        '(20 thousand messages/s without loss on half a core) is missed.',
        (_seconds(10.0, 'length of a run'),),
    ),
    'explain': Bench(
        'explain',
        'explain labelled recordings and compare with what was concealed',
        "Explains every NAME.mcap of FOLDER that has a NAME.truth.json, with the folder's "
        'plant.yaml, and prints what was reported beside what was concealed. NAME.baseline.mcap is '
        'a healthy recording of the same rig, NAME.second.mcap a second one to judge on. Exits 1 '
        'if one is wrong.',
        (
            _option('folder', 'of labelled recordings', type=Path, metavar='FOLDER'),
            _option('--only', 'these cases alone', nargs='+', metavar='NAME'),
            _jobs(2),
        ),
    ),
    'concealed': Bench(
        'concealed.trial',
        'explain rigs that are drawn with something concealed in them',
        'Draws rigs with something concealed, explains a recording of each, and prints a line for '
        'each case and a table. Every seed is a case of every stratum. Seeds from 1 to 99 are for '
        'development; of others, first runs are reported. With --json each case is kept once it is '
        'known, and what the file has is not explained again: a long run goes on where it was '
        'stopped. Exits 1 if a case could not be explained, or differs from --against.',
        (
            _strata(),
            _seeds('of the cases (default: 1-3)'),
            _jobs(),
            _file('--json', 'file for all rows'),
            _file(
                '--against', 'rows of an earlier run: explain the same cases, and say what differs'
            ),
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
    'criteria': Bench(
        'concealed.criteria',
        'derive the numbers by which explanations are judged',
        'Reads rows of `endoscope bench concealed --json`, derives the numbers of '
        'endoscope_explain/criteria.py from them, and prints what half and double of each would '
        'do.',
        (
            _option('rows', 'of rows', nargs='+', type=Path, metavar='FILE'),
            _file('--write', 'module to write'),
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
            _option('--derive', 'derive the thresholds from the correct ones', action='store_true'),
            _file('--write', 'module for them'),
            _jobs(),
        ),
    ),
    'recordings': Bench(
        'recordings',
        'explain recordings of the simulated slave with its own plant',
        'Draws for every seed what somebody does with the graph while it is recorded, in lock-step '
        'or real time, cuts the recording anywhere, and explains it with the plant that was '
        'simulated: nothing is missing. Seeds from 1 to 99 are for development; of others, first '
        'runs are reported. What is done already in DIR is not done again.',
        (
            _seeds('of the recordings (1-3)'),
            _option(
                '--out',
                'for bags and rows',
                type=Path,
                default=Path('own_recordings'),
                metavar='DIR',
            ),
            _jobs(),
        ),
    ),
    'watch': Bench(
        'watch.trial',
        'whether a rig that becomes different while it moves is noticed',
        'Changes a moving rig in each of ten ways for every seed, and prints how many changes were '
        'told within 10 s of motion, and at the right stage; then moves rigs that stay as they '
        'are, 10 min each, and prints the false alarms. Seeds from 1 to 999 are for development; '
        'of others, first runs are reported.',
        (
            _seeds('of the changes (1-3)'),
            _seeds('of rigs that stay as they are (1-6)', '--nominal', last=6),
            _only('change'),
            _option('--derive', 'derive the thresholds from these', action='store_true'),
            _file('--write', 'module for them'),
            _file('--json', 'file for all rows; what is in it is not done again'),
            _seconds(86400.0, 'take what there is after so long, in s', '--within'),
            _jobs(),
        ),
    ),
    'adopt': Bench(
        'adopt',
        'how a rig tracks by the inverse of the plant that was found',
        'Draws for every seed a rig with a large effect that its description lacks, explains a '
        'recording of it, adopts what was found, and prints how the tip tracks another motion by '
        'the inverse of the plant as described, as found and as it is. Seeds from 1 to 100 are for '
        'development; of others, first runs are reported. Exits 1 where half of the rigs keep more '
        'than 25 % of the error.',
        (
            _seeds('of effects that an inverse can know (1-3)'),
            _option('--others', 'of the other effects (none)', type=seeds, metavar='A-B'),
            _option('--foreign', 'of another simulator (none)', type=seeds, metavar='A-B'),
            _file('--json', 'file for all rows; what is in it is not done again'),
            _seconds(86400.0, 'take what there is after so long, in s', '--within'),
            _jobs(),
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
    'watched': Bench(
        'watch.cost',
        'what it costs the graph that the rig is watched',
        'Runs all nodes in one process, 1000 ticks a second, with and without the watch, in '
        'lock-step and by the wall clock, and prints CPU time, ticks and the time from command to '
        'motor. Exits 1 where watching costs more than 10 % of a core.',
        (
            _seconds(10.0, 'of each run, once the watch has learnt'),
            _count('--rounds', 'of the runs', 2),
        ),
    ),
    'limits': Bench(
        'concealed.limits',
        'how weak an effect may be and still be named',
        'Makes each effect of the catalogue weaker by about a third at a time until it is not '
        'named on one of some rigs, and prints the last strength at which it was.',
        (
            _option('--effects', '(default: all that are drawn)', nargs='+', metavar='ID'),
            _seeds('of the rigs (default: 1-3)'),
            _jobs(),
        ),
    ),
    'real': Bench(
        'real.tables',
        'explain real recordings of a flexible endoscope by one physics',
        'Fits five tubes together on their first cycle and searches what they lack, predicts the '
        'second cycles, and carries what was found to the rig in other states. The recordings are '
        'no part of this project: optimization/selected and operation/optimizer_input of '
        'nhoyh/hysteresis_compensation_ROS, in one folder.',
        (
            _option('folder', 'folder of the recordings', type=Path),
            _option(
                '--out',
                'page to write (real.html)',
                type=Path,
                default=Path('real.html'),
                metavar='FILE',
            ),
            _option(
                '--taken-out',
                'take each piece of the nominal physics out of each tube in turn instead, and look '
                'for it; prints a table',
                action='store_true',
            ),
            _jobs(),
        ),
    ),
    'simulate': Bench(
        'simulate',
        'how much faster than real time the plant is simulated, bare and with each effect',
        'Simulates two joints and prints the ratio to real time with nothing on, and the cost of '
        'each effect of the catalogue on both joints. Exits 1 where the bare plant is below 1000 '
        'times real time.',
        (_count('--runs', 'runs of each, of which the fastest counts', 7),),
    ),
    'calibration_rate': Bench(
        'calibration_rate',
        'what a calibration loses where load cells are read slowly',
        'Calibrates tubes that nothing was fitted on with load cells read at 100 Hz to 1 kHz, each '
        'reading up to a fifth of the interval early or late; then at 200 Hz with one gap where '
        'the tension bends most, and with readings older than their stamps. Exits 1 if at some '
        'rate a class is wrong or more than one known tube of a hundred is refused.',
        (_seed('chooses tubes, rigs and noise'), _count('--tubes', 'tubes a class', 10)),
    ),
    'cells': Bench(
        'cells',
        'how a calibration fares with load cells as they are',
        'Calibrates instruments that nothing was trained on, with good cells at 1000, 200 and 100 '
        'Hz, with errors of zero and gain, with cells that drift, clip, stick, are slow, exchanged '
        'or unplugged, and in tubes of 30 and 120 deg: right, wrong, refused.',
        (
            _seed('chooses rigs, tubes and noise'),
            _count('--tubes', 'tubes a class', 20),
            _option(
                '--motion', 'calibration motion: sinusoid or brief (sinusoid)', default='sinusoid'
            ),
            _file('--weights', 'from `endoscope train` (those of the product)'),
        ),
    ),
    'papers': Bench(
        'papers.papers',
        "the papers' tables beside ours",
        'Measures what the two papers report, on tube configurations that nothing was fitted on, '
        'and prints it beside their figures: tension_by_shape, classifiers, nearest_class, '
        'colon_shapes, compensators, reach, changing_tube, calibration_time, real_sizes, '
        'real_recordings. Exits 1 if an aim is missed.',
        (
            _seed('chooses tubes, rigs and noise'),
            _count('--tubes', 'tube configurations of each row', 5),
            _only('table'),
        ),
    ),
    'motor_bus': Bench(
        'motor_bus',
        'cycles per second of two emulated servos, beside what the line carries',
        'Runs the motor bus (a sync write and a sync read a cycle, torque on) against two servos '
        'that are emulated on a pseudo-terminal with the delays of the line, at 57 600, 1 000 000 '
        'and 4 000 000 baud. Exits 1 where a cycle fails.',
        (_seconds(10.0, 'length of a run'),),
    ),
    'motor_faults': Bench(
        'faults.motor_faults',
        'what the slave does when motors or master fail, and how fast',
        'Runs master, compensator, motor driver, supervisor and recorder on emulated servos, '
        'breaks one thing after the other in motion, and prints a table. Exits 1 where the slave '
        'does not end as it must.',
        (_only('fault'),),
    ),
    'faults': Bench(
        'faults.faults',
        'what the slave does when a node dies or stalls, or a second sender appears',
        'Runs the graph on the simulated slave, each node a process, breaks one thing after the '
        'other at random instants of the motion, enables anew, and prints a table. Exits 1 where '
        'the slave moved without an enable, a step was beyond the bound of the shaper, or an '
        'enable did not work.',
        (
            _option('--repetitions', 'of each fault (default: 100)', type=COUNT, default=100),
            _option('--rate', 'ticks/s (default: 500)', type=COUNT, default=500),
            _option('--composed', 'all nodes in one process', action='store_true'),
            _seed('of all chance'),
            _only('fault'),
        ),
    ),
    'files': Bench(
        'hostile_files.trial',
        'what the readers do with damaged and crafted files',
        'Damages files of each kind at random, by bytes and by their structure, reads them in '
        'processes of 2 GB and 60 s a file, and prints a table. Exits 1 where a file ended '
        'otherwise than in one line or a correct answer.',
        (
            _count('--cases', 'files of each kind', 300),
            _seed('of the damage', 0),
            _only('kind'),
            _jobs(2),
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
