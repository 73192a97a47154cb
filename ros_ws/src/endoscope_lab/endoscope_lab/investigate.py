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
from endoscope_core.signals.sampled_motion import CommandTable, read_command_file
from endoscope_explain.audit import audit_recording
from endoscope_explain.case import ExplainedCase, Inputs, Sources
from endoscope_explain.explanation import Explanation
from endoscope_explain.investigation.investigation import (
    EXPERIMENTS,
    Investigation,
    KnownOfRig,
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
CALIBRATED, ASKED, COMMISSIONED = 'calibration', 'loop', 'one motion'
"""What a rig is explained by: the loop's first motion, the whole loop, and one motion of 29 s that
is fixed beforehand."""
UNDER_WAY = 'under way'
ONE, TWO = 'one effect', 'two effects'
KINDS = {TWO: 'pairs', ONE: 'catalogue', 'other simulator': 'other_simulator'}
"""Strata of `endoscope bench concealed` from which rigs are drawn."""
COLUMNS = (
    *('rigs', 'explained by', 'number', 'class right', 'names a class', 'named first', 'alone'),
    *('false names', 'became wrong', 's to it, median', '90 %', 's of motion', 'most motions'),
    *('cut short', 'CPU s'),
)
"""*Alone*: the right name is first and the only one left, *it*; *became wrong*: it was left after
some motions, and another one was first after more."""


@dataclass(frozen=True, kw_only=True)
class Asked(Row):
    """The judged explanation of a rig after some motions."""

    by: str
    experiments: int = 0  # after the calibration
    motion_s: float = math.nan
    stopped: str = ''  # why no further motion was requested
    cpu_s: float = math.nan  # of all work for this row

    @property
    def alone(self) -> bool:
        """Whether what was injected is named first, nothing else is, and nothing is left open."""
        right = self.first_of_identifiable and self.in_set
        return right and not self.false and self.set_size == 1.0


def run(args: argparse.Namespace) -> int:
    """Print a line for each rig and method, then the table; return 1 if a rig failed."""
    before = rows_so_far(args.json, Asked)
    done = {row.seed for row in before if row.by == COMMISSIONED} & set(args.seeds)
    until = time.time() + 60.0 * args.minutes
    calls = [
        (kind_of(seed), seed, args.rig_minutes, until, args.json)
        for seed in args.seeds
        if seed not in done
    ]
    # A rig that was broken off is begun again.
    begun: dict[int, list[Asked]] = {}
    for row in before:
        begun[row.seed] = [*(begun.get(row.seed, []) if row.by != CALIBRATED else []), row]
    rows = [row for seed in done for row in begun[seed]]
    for call, future in side_by_side(args.jobs, asked, calls):
        error = future.exception()
        found = _failed(*call[:2], error, args.json) if error else future.result()
        rows += found
        for row in found:
            print(f'{row.by:12s}{row.experiments:2d} {row.line()}', flush=True)
    whole = {row.seed for row in rows if row.by == COMMISSIONED}
    print('\n' + table([row for row in rows if row.seed in whole]))
    print(f'\n{len(whole)} of {len(args.seeds)} rigs')
    return 1 if any(row.verdict == 'FAILED' for row in rows) else 0


def kind_of(seed: int) -> str:
    """Stratum of a seed: of four, one has two effects, one a single, two the other simulator.

    The pairs are simulated by the kernel.
    """
    return KINDS[('other simulator', TWO, 'other simulator', ONE)[(seed + 1) % 4]]


def asked(
    stratum: str, seed: int, rig_minutes: float, until: float, file: Path | None
) -> list[Asked]:
    """Explain a rig by the loop, after each of its motions, and by one fixed motion, on one core.

    Nothing starts after `until`, seconds since the epoch, and the loop plays no further motion
    after `rig_minutes`. Every row is appended to a file as it is there.
    """
    if time.time() > until:
        return []
    case, read = drawn_rig(stratum, seed)
    rows: list[Asked] = []

    def keep(by: str, answer: _Answer, experiments: int = 0, stopped: str = '') -> None:
        row = Asked(
            **vars(judged_row(case, answer.explanation, answer.seconds)),
            by=by,
            experiments=experiments,
            motion_s=answer.motion_s,
            stopped=stopped,
            cpu_s=answer.cpu_s,
        )
        rows.append(row)
        keep_row(file, row)

    rig = SimulatedRig(case, read, min(until, time.time() + 60.0 * rig_minutes))

    def explain(bags: Sequence[Path], known: KnownOfRig) -> ExplainedCase:
        found = rig.explain(bags, known)
        assert rig.last is not None
        keep(ASKED if len(bags) > 1 else CALIBRATED, rig.last, len(bags) - 1, UNDER_WAY)
        return found

    with tempfile.TemporaryDirectory() as scratch, threadpool_limits(1):
        described = Path(scratch) / 'described.yaml'
        save_plant(case.described, described)
        of = Investigation(Path(scratch) / 'out', described, shipped_rig(), EXPERIMENTS, jobs=1)
        log = investigate(of, rig.play, explain)
    if rig.last is None:
        raise EndoscopeError(log.words)
    keep(ASKED, rig.last, len(log.whole) - 1, str(log.stopped))
    if time.time() < until:
        fixed = commissioning(case.described, shipped_rig())
        recording = SimulatedRig(case, read, until).recorded(fixed.table, COMMISSIONED)
        keep(COMMISSIONED, explained([recording], case.described, fixed.duration)[1])
    return rows


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

    def explain(self, bags: Sequence[Path], known: KnownOfRig) -> ExplainedCase:
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
    known: KnownOfRig = MappingProxyType({}),
) -> tuple[ExplainedCase, _Answer]:
    """Explain recordings of one rig together, on one core."""
    audits = [audit_recording(recordings[0], plant)]
    for one in recordings[1:]:
        audits.append(audit_recording(one, plant, audits[-1]))
    inputs = [
        Inputs(Sources(Path(audit.recording.name), plant, quick=True, jobs=1, known=known), audit)
        for audit in audits
    ]
    begun, begun_cpu = time.monotonic(), time.process_time()
    case = explain_case(inputs_joined(inputs))
    explanation = replace(
        case.explanation, verdict=case.verdict, effects=case.effects, augmented=case.plant
    )
    seconds, cpu_s = time.monotonic() - begun, time.process_time() - begun_cpu
    return case, _Answer(explanation, motion_s, seconds, cpu_s)


def table(rows: Sequence[Asked]) -> str:
    """A line for each kind of rig and method, and one for each method over all rigs."""
    groups = {name: [stratum] for name, stratum in KINDS.items()}
    groups['all'] = list(KINDS.values())
    lines = [table_head(*COLUMNS)]
    for name, strata in groups.items():
        for by in (CALIBRATED, ASKED, COMMISSIONED):
            stages = _by_rig(rows, by, strata)
            if stages:
                lines.append(table_row(name, by, *_cells(stages)))
    return '\n'.join(lines)


def _by_rig(rows: Sequence[Asked], by: str, strata: Sequence[str]) -> list[list[Asked]]:
    """Rows by one way of each rig that was explained by it, in turn; of the loop, all of it."""
    kept = (by, CALIBRATED) if by == ASKED else (by,)
    found: dict[int, list[Asked]] = {}
    for row in rows:
        if row.stratum in strata and row.by in kept:
            found.setdefault(row.seed, []).append(row)
    return [of_it for of_it in found.values() if of_it[-1].by == by]


def _cells(rigs: Sequence[Sequence[Asked]]) -> tuple[str, ...]:
    rows = [stages[-1] for stages in rigs]

    def share(name: str) -> str:
        return f'{100.0 * np.mean([getattr(row, name) for row in rows]):.0f} %'

    def mean(name: str, decimals: int) -> str:
        known = [value for row in rows if not math.isnan(value := getattr(row, name))]
        return f'{np.mean(known):.{decimals}f}' if known else '-'

    wrong = sum(
        any(r.alone for r in stages) and not stages[-1].first_of_identifiable for stages in rigs
    )
    seconds = [_seconds(stages) for stages in rigs]
    middle, most = (np.quantile(seconds, p, method='higher') for p in (0.5, 0.9))
    cut = sum(row.stopped in (Stop.INTERRUPTED, Stop.FAULT) for row in rows)
    return (
        str(len(rows)),
        share('in_set'),
        mean('set_size', 1),
        share('first_of_identifiable'),
        share('alone'),
        str(sum(row.false for row in rows)),
        str(wrong),
        *('never' if math.isinf(s) else f'{s:.0f}' for s in (middle, most)),
        mean('motion_s', 0),
        str(max(row.experiments for row in rows) + 1),
        str(cut),
        mean('cpu_s', 0),
    )


def _seconds(stages: Sequence[Asked]) -> float:
    """Motion in s after which the right name is left, and stays; infinite where it never is."""
    since = math.inf
    for row in stages:
        since = min(since, row.motion_s) if row.alone else math.inf
    return since


def _failed(stratum: str, seed: int, error: BaseException, file: Path | None) -> list[Asked]:
    row = vars(failed(stratum, seed, error))
    rows = [Asked(**row, by=by) for by in (CALIBRATED, ASKED, COMMISSIONED)]
    for each in rows:
        keep_row(file, each)
    return rows
