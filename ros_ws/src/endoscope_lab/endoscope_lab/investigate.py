"""`endoscope bench investigate`: rigs with injected effects, investigated until explained."""

import argparse
import math
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from endoscope_core.errors import EndoscopeError, NotPlayedError, RigStoppedError
from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.plant_file import save_plant
from endoscope_core.rig import shipped_rig
from endoscope_core.signals.calibration_motion import calibration_sinusoid
from endoscope_core.signals.sampled_motion import CommandTable, read_command_file
from endoscope_explain.audit import audit_recording
from endoscope_explain.case import ExplainedCase, Inputs, Sources
from endoscope_explain.experiment_motions import SAMPLE_S, as_played, library
from endoscope_explain.explanation import Explanation
from endoscope_explain.investigation.investigation import (
    EXPERIMENTS,
    Investigation,
    Known,
    investigate,
)
from endoscope_explain.investigation.log import Stop
from endoscope_explain.investigation.motions import RigMotion, commissioning
from endoscope_explain.pipeline import explain_case
from endoscope_explain.recording import RigRecording
from endoscope_explain.takes import APART_S, inputs_joined
from endoscope_lab.bench import keep_row, rows_so_far, side_by_side, table_head, table_row
from endoscope_lab.concealed.another_rig import Laws
from endoscope_lab.concealed.another_rig import read as read_another
from endoscope_lab.concealed.judge import Case
from endoscope_lab.concealed.other_simulator import of_other_simulator
from endoscope_lab.concealed.readings import TRACKER_TICKS, Readings, as_sensed
from endoscope_lab.concealed.readings import read as read_own
from endoscope_lab.concealed.row import Row
from endoscope_lab.concealed.strata import drawn_case
from endoscope_lab.concealed.trial import failed, judged_row

Array = NDArray[np.float64]

TICK = 1e-3
CALIBRATED, COMMISSIONED, ASKED, FIXED = 'calibration', 'one motion', 'asked', 'fixed'
"""What a rig is explained by: a calibration's sinusoid, the commissioning motion, the loop, and one
motion fixed beforehand, as long as all motions of the loop together."""
UNDER_WAY = 'under way'
ONE, TWO = 'one effect', 'two effects'
KINDS = {TWO: 'pairs', ONE: 'catalogue', 'other simulator': 'other_simulator'}
"""Strata of `endoscope bench concealed` from which rigs are drawn."""
COLUMNS = (
    *('rigs', 'explained by', 'number', 'class right', 'names a class', 'named first'),
    *('exact set', 'false names', 'improved', '80th', 'experiments', 'most', 's of motion'),
    *('cut short', 'CPU s'),
)


@dataclass(frozen=True, kw_only=True)
class Asked(Row):
    """The judged explanation of a rig after some motions."""

    by: str
    experiments: int = 0  # after the commissioning motion
    motion_s: float = math.nan
    stopped: str = ''  # why no further motion was requested
    cpu_s: float = math.nan  # of all work for this row


def run(args: argparse.Namespace) -> int:
    """Print a line for each rig and method, then the table; return 1 if a rig failed."""
    before = rows_so_far(args.json, Asked)
    done = {row.seed for row in before if row.by == FIXED}
    until = time.time() + 60.0 * args.minutes
    calls = [
        (kind_of(seed), seed, args.rig_minutes, until, args.json)
        for seed in args.seeds
        if seed not in done
    ]
    found = list(before)
    for call, future in side_by_side(args.jobs, asked, calls):
        error = future.exception()
        rows = _failed(*call[:2], error, args.json) if error else future.result()
        found += rows
        for row in rows:
            print(f'{row.by:11s}{row.line()}', flush=True)
    # Of a rig that was started again, the last row.
    last = {(row.seed, row.by): row for row in found if row.seed in args.seeds}
    rows = list(last.values())
    print('\n' + table(rows))
    whole = [row for row in rows if (row.seed, FIXED) in last]
    if len(whole) < len(rows):
        print('\nOf these, rigs that were explained by all of them:\n\n' + table(whole))
    print(f'\n{len({row.seed for row in rows})} of {len(args.seeds)} rigs')
    return 1 if any(row.verdict == 'FAILED' for row in rows) else 0


def kind_of(seed: int) -> str:
    """Stratum of a seed: of four, one has two effects, one a single, two the other simulator.

    The pairs are simulated by the kernel.
    """
    return KINDS[('other simulator', TWO, 'other simulator', ONE)[(seed + 1) % 4]]


def asked(
    stratum: str, seed: int, rig_minutes: float, until: float, file: Path | None
) -> list[Asked]:
    """Explain a rig by one motion, by the loop and by a fixed motion, on one core.

    Nothing starts after `until`, seconds since the epoch, and the loop plays no further motion
    after `rig_minutes`. Every row is appended to a file, those of the loop as it runs.
    """
    if time.time() > until:
        return []
    case, read = drawn_rig(stratum, seed)
    rows: dict[str, Asked] = {}

    def keep(by: str, answer: _Answer, experiments: int = 0, stopped: str = '') -> None:
        rows[by] = Asked(
            **vars(judged_row(case, answer.explanation, answer.seconds)),
            by=by,
            experiments=experiments,
            motion_s=answer.motion_s,
            stopped=stopped,
            cpu_s=answer.cpu_s,
        )
        keep_row(file, rows[by])

    rig = SimulatedRig(case, read, min(until, time.time() + 60.0 * rig_minutes))

    def explain(bags: Sequence[Path], known: Known) -> ExplainedCase:
        found = rig.explain(bags, known)
        assert rig.last is not None
        if len(bags) == 1:
            keep(COMMISSIONED, rig.last)
        else:
            keep(ASKED, rig.last, len(bags) - 1, UNDER_WAY)
        return found

    with tempfile.TemporaryDirectory() as scratch, threadpool_limits(1):
        described = Path(scratch) / 'described.yaml'
        save_plant(case.described, described)
        of = Investigation(Path(scratch) / 'out', described, shipped_rig(), EXPERIMENTS, jobs=1)
        log = investigate(of, rig.play, explain)
    if rig.last is None:
        raise EndoscopeError(log.words)
    first = commissioning(case.described, shipped_rig())
    if time.time() < until:
        sinusoid = calibration(first.table.joints)
        recording = SimulatedRig(case, read, until).recorded(sinusoid, CALIBRATED)
        keep(CALIBRATED, explained([recording], case.described, float(sinusoid.time[-1]))[1])
    experiments = len(log.whole) - 1
    keep(ASKED, rig.last, experiments, str(log.stopped))
    if not experiments:
        keep(FIXED, rig.last)
    elif time.time() < until:
        motion_s = rig.last.motion_s
        motion = fixed_motion(first, motion_s)
        again = SimulatedRig(case, read, until)
        keep(FIXED, explained([again.recorded(motion, FIXED)], case.described, motion_s)[1])
    return list(rows.values())


def drawn_rig(stratum: str, seed: int) -> tuple[Case, Callable[[Array], Readings]]:
    """A rig with injected effects, and its readings under a shaft command (N, J), every ms."""
    if stratum == KINDS['other simulator']:
        case, truth = of_other_simulator(np.random.default_rng([seed, 0]), None)
        case = replace(case, stratum=stratum, seed=seed)
        ((_, joint),) = case.true.joints.items()
        return case, partial(read_another, joint, Laws(**truth['laws']))
    case = drawn_case(stratum, seed)
    return case, partial(read_own, case.true)


@dataclass(frozen=True)
class _Answer:
    """An explanation after some motions."""

    explanation: Explanation
    motion_s: float  # length of all motions
    seconds: float  # time of explaining, and CPU time of it
    cpu_s: float


class SimulatedRig:
    """A rig with injected effects that plays requested motions one after the other."""

    def __init__(self, case: Case, read: Callable[[Array], Readings], until: float) -> None:
        self._case, self._read, self._until = case, read, until
        self._noise = np.random.default_rng([case.seed, 1])
        self._command = np.empty((0, len(case.true.joints)))
        self._recordings: dict[Path, RigRecording] = {}
        self._motion_s = self._cpu_s = 0.0
        self.last: _Answer | None = None

    def play(self, motion: RigMotion, file: Path, bag: Path) -> None:
        """Play the motion of a file; the rig stops by itself if a wire is too tight."""
        if time.time() > self._until:
            raise NotPlayedError('its time is over')
        recording = self.recorded(read_command_file(file), bag.name)
        assert recording.tension is not None
        ceiling = recording.rig.tension.ceiling
        if (largest := float(recording.tension.values.max())) > ceiling:
            raise RigStoppedError(f'a wire at {largest:.0f} N')
        self._recordings[bag] = recording
        self._motion_s += motion.duration

    def explain(self, bags: Sequence[Path], known: Known) -> ExplainedCase:
        """Explain recordings together, as `explain_together` does bags."""
        recordings = [self._recordings[bag] for bag in bags]
        case, answer = explained(recordings, self._case.described, self._motion_s, known)
        self._cpu_s += answer.cpu_s
        self.last = replace(answer, cpu_s=self._cpu_s)
        return case

    def recorded(self, table: CommandTable, name: str) -> RigRecording:
        """Readings of a motion that is played after all earlier ones and a rest."""
        ticks = np.arange(0.0, table.time[-1], TICK)
        columns = [table.joints.index(joint) for joint in self._case.true.joint_names()]
        angle = np.column_stack([np.interp(ticks, table.time, table.angle[:, k]) for k in columns])
        rest = np.repeat(self._command[-1:], _rest(len(self._command)), axis=0)
        begin = len(self._command) + len(rest)
        self._command = np.concatenate([self._command, rest, shipped_rig().joints.gear * angle])
        return replace(
            as_sensed(
                _since(self._read(self._command), begin),
                self._case.true.joint_names(),
                self._case.true.sensors,
                int(self._noise.integers(2**31)),
            ),
            name=name,
        )


def _rest(ticks: int) -> int:
    """Ticks of rest after a motion of some ticks: to a whole second, as recordings are joined."""
    return math.ceil(ticks * TICK + APART_S) * round(1.0 / TICK) - ticks


def _since(readings: Readings, begin: int) -> Readings:
    """Readings from a tick on, with stamps that start at zero."""
    values = {
        key: value[begin // TRACKER_TICKS if key in ('tracker_time', 'bending') else begin :]
        for key, value in vars(readings).items()
    }
    values['time'] = values['time'] - begin * TICK
    values['tracker_time'] = values['tracker_time'] - begin * TICK
    return Readings(**values)


def explained(
    recordings: Sequence[RigRecording],
    plant: PlantDescription,
    motion_s: float,
    known: Known = MappingProxyType({}),
) -> tuple[ExplainedCase, _Answer]:
    """Explain recordings of one rig together, on one core."""
    inputs = [
        Inputs(
            Sources(Path(one.name), plant, quick=True, jobs=1, known=known),
            audit_recording(one, plant),
        )
        for one in recordings
    ]
    begun, begun_cpu = time.monotonic(), time.process_time()
    case = explain_case(inputs_joined(inputs))
    explanation = replace(
        case.explanation, verdict=case.verdict, effects=case.effects, augmented=case.plant
    )
    seconds, cpu_s = time.monotonic() - begun, time.process_time() - begun_cpu
    return case, _Answer(explanation, motion_s, seconds, cpu_s)


def calibration(joints: tuple[str, ...]) -> CommandTable:
    """The sinusoid of a calibration, on joints by name."""
    sinusoid = calibration_sinusoid()
    time = np.arange(0.0, sinusoid.duration + SAMPLE_S, SAMPLE_S)
    return CommandTable(joints, time, np.column_stack([sinusoid(time)[0]] * len(joints)))


def fixed_motion(first: RigMotion, duration: float) -> CommandTable:
    """A motion of some length, fixed beforehand: the first one, then all of the library in turn."""
    # The library is what the loop chooses from, in its order, on one joint after the other.
    joints, names = first.joint.split(' and '), first.table.joints
    reaches = tuple((joint, first.largest) for joint in joints)
    by_joint = [library(joint, reaches, shipped_rig()) for joint in joints]
    angles = [each.angle for motions in zip(*by_joint, strict=True) for each in motions]
    rest = np.zeros((sum(map(len, angles)), len(names)))
    rest[:, [names.index(joint) for joint in joints]] = np.concatenate(angles)
    count = math.ceil((duration - first.duration) / SAMPLE_S)
    rest = np.tile(rest, (math.ceil(count / len(rest)), 1))[:count]
    time, angle = as_played(
        np.asarray(SAMPLE_S * np.arange(len(rest)), np.float64), rest, shipped_rig()
    )
    return CommandTable(
        names,
        np.concatenate([first.table.time, first.duration + SAMPLE_S + time]),
        np.concatenate([first.table.angle, angle]),
    )


def table(rows: Sequence[Asked]) -> str:
    """A line for each kind of rig and method, and one for each method over all rigs."""
    groups = {name: [stratum] for name, stratum in KINDS.items()}
    groups['all'] = list(KINDS.values())
    lines = [table_head(*COLUMNS)]
    for name, strata in groups.items():
        for by in (CALIBRATED, COMMISSIONED, ASKED, FIXED):
            of_it = [row for row in rows if row.by == by and row.stratum in strata]
            if of_it:
                lines.append(table_row(name, by, *_cells(of_it)))
    return '\n'.join(lines)


def _cells(rows: Sequence[Asked]) -> tuple[str, ...]:
    def share(name: str) -> str:
        return f'{100.0 * np.mean([getattr(row, name) for row in rows]):.0f} %'

    def mean(name: str, decimals: int) -> str:
        known = [value for row in rows if not math.isnan(value := getattr(row, name))]
        return f'{np.mean(known):.{decimals}f}' if known else '-'

    # A failed explanation predicts nothing.
    left = np.nan_to_num([row.augmented for row in rows], nan=np.inf)
    cut = sum(row.stopped in (Stop.INTERRUPTED, Stop.FAULT, UNDER_WAY) for row in rows)
    return (
        str(len(rows)),
        share('in_set'),
        mean('set_size', 1),
        share('first'),
        share('exact'),
        str(sum(row.false for row in rows)),
        f'{np.median(left):.3g}',
        f'{np.quantile(left, 0.8, method="higher"):.3g}',
        mean('experiments', 1),
        str(max(row.experiments for row in rows)),
        mean('motion_s', 0),
        str(cut),
        mean('cpu_s', 0),
    )


def _failed(stratum: str, seed: int, error: BaseException, file: Path | None) -> list[Asked]:
    row = vars(failed(stratum, seed, error))
    rows = [Asked(**row, by=by) for by in (COMMISSIONED, ASKED, FIXED)]
    for each in rows:
        keep_row(file, each)
    return rows
