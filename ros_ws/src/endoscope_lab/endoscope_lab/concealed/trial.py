"""`endoscope bench concealed`: what is said of rigs with something drawn and concealed."""

import argparse
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import isclose
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from endoscope_core.physics import PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.criteria import INTERVAL_WIDTH
from endoscope_explain.explain_recording import explain_recording
from endoscope_explain.explanation import Estimate, Explanation, NamedEffect
from endoscope_lab.bench import (
    keep_row,
    kept_rows,
    require_known,
    side_by_side,
    table_head,
    table_row,
)
from endoscope_lab.concealed.judge import (
    Case,
    Judgement,
    Law,
    is_instead,
    is_of,
    judged,
    statements,
)
from endoscope_lab.concealed.readings import misfit
from endoscope_lab.concealed.strata import STRATA, drawn_case
from endoscope_lab.concealed.strength import left


def run(args: argparse.Namespace) -> int:
    """Print a line for each case, then the table; return 1 if a case failed or differs."""
    strata = args.stratum or list(STRATA)
    require_known('stratum', strata, STRATA)
    before = rows_of(args.against) if args.against else {}
    cases = list(before) or [(name, seed) for seed in args.seeds for name in strata]
    kept = rows_of(args.json) if args.json and args.json.exists() else {}
    rows = {case: kept[case] for case in cases if case in kept}
    for case, future in side_by_side(args.jobs, explained, [c for c in cases if c not in rows]):
        error = future.exception()
        rows[case] = failed(*case, error) if error else future.result()
        print(rows[case].line(), flush=True)
        keep_row(args.json, rows[case])
    known = list(STRATA)
    print('\n' + table([rows[case] for case in sorted(cases, key=lambda c: known.index(c[0]))]))
    differ = [(c, each) for c in before for each in differences(before[c], rows[c])]
    for (stratum, seed), each in differ:
        print(f'{stratum} {seed}: {each}')
    if before:
        print(f'{len(differ)} differences from {args.against} in {len(before)} cases')
    return 1 if differ or any(row.verdict == 'FAILED' for row in rows.values()) else 0


GOOD = 1.3
"""Rmse over noise up to which a second recording is predicted."""
COLUMNS = (
    *('stratum', 'cases', 'told apart', 'named first of these', 'of all', 'right place'),
    *('exact set', 'false names', 'in set', 'names a set', 'intervals', 'described', 'refitted'),
    *('improved', '80th', 's, median', '95th'),
)


@dataclass(frozen=True, kw_only=True)
class Row(Judgement):
    """What was concealed, what was said, and how far it is right."""

    stratum: str
    seed: int
    concealed: tuple[str, ...]  # laws with their joints
    note: str  # what is particular to the case
    moved: float  # what the laws change, over the signal
    left: float  # what a refit of the rig's numbers leaves of them, over noise
    verdict: str
    said: tuple[str, ...]  # names with their joints, most certain first
    # Intervals that hold the true number, of how many: those of the plant, and of the numbers of
    # named effects that could be measured another way.
    held: int = 0
    intervals: int = 0
    # Misfit of the second recording over noise, of the worst signal.
    nominal: float = math.nan
    refitted: float = math.nan
    augmented: float = math.nan
    seconds: float = math.nan  # that explaining took
    # What is left over what rigs of another form leave, of the worst joint.
    beyond_form: float = math.nan
    # Error of each number over what its interval would allow on that side with an `INTERVAL_WIDTH`
    # of one.
    errors: tuple[float, ...] = ()
    # Evidence of each named effect, with how many rivals it has, and whether it is right.
    evidence: tuple[dict[str, float], ...] = ()
    # The laws that are told from other numbers, and whether the first statements name these.
    told: tuple[str, ...] = ()
    first_of_told: bool = True

    @property
    def is_told_apart(self) -> bool:
        """Whether laws, if any, are told from other numbers and a second recording misses them."""
        return not self.concealed or (bool(self.told) and not self.refitted <= GOOD)

    def line(self) -> str:
        right = 'right' if self.exact else 'first' if self.first else 'place' if self.place else ''
        ratios = ' > '.join(f'{x:.3g}' for x in (self.nominal, self.refitted, self.augmented))
        note = f' [{self.note}]' if self.note else ''
        return (
            f'{self.stratum:17s}{self.seed:4d}  {right or "WRONG":6s}{self.seconds:6.1f} s  '
            f'{" + ".join(self.concealed) or "nothing"}{note}, moves {100.0 * self.moved:.0f} %, '
            f'a refit leaves {self.left:.2g}: '
            f'{self.verdict}, {" + ".join(self.said) or "nothing"}; second {ratios}'
        )


def explained(stratum: str, seed: int) -> Row:
    """Draw a case, explain it on one core, and judge what is said."""
    return row_of(drawn_case(stratum, seed))


def explanation_of(case: Case) -> tuple[Explanation, float]:
    """Explain a case on one core; also, how many seconds that took."""
    with threadpool_limits(1):
        begun = time.monotonic()
        said = explain_recording(
            case.recording, case.described, baseline=case.baseline, left_out=case.left_out, jobs=1
        )
        return said, time.monotonic() - begun


def row_of(case: Case) -> Row:
    """Explain a case on one core, and judge what is said."""
    return judged_row(case, *explanation_of(case))


def judged_row(case: Case, said: Explanation, seconds: float) -> Row:
    """Judge what is said of a case after some seconds."""
    names = statements(said)
    errors = [_error(*number) for number in _numbers(case, said)]
    judgement = judged(case.laws, names, case.also)
    in_set = judgement.in_set or is_instead(said, case.laws)
    judgement = replace(judgement, in_set=in_set)
    told = told_from_numbers(case)
    others = frozenset().union(*(law.ids for law in case.laws if law not in told))
    nominal, refitted, augmented = (
        misfit(plant, case.second, case.described.sensors)
        for plant in (said.nominal, said.refitted, said.augmented)
    )
    return Row(
        stratum=case.stratum,
        seed=case.seed,
        concealed=tuple(map(_named, case.laws)),
        note=case.note,
        moved=case.moved,
        left=_left(case),
        verdict=str(said.verdict),
        said=tuple(f'{each.name}@{each.joint}' for each in names),
        held=sum(error <= 1.0 for error in errors),
        intervals=len(errors),
        nominal=nominal,
        refitted=refitted,
        augmented=augmented,
        seconds=seconds,
        beyond_form=said.beyond_form,
        errors=tuple(INTERVAL_WIDTH * error for error in errors),
        evidence=tuple(_evidence(effect, case) for effect in said.effects),
        told=tuple(map(_named, told)),
        first_of_told=judged(told, names, case.also | others).first,
        **vars(judgement),
    )


def told_from_numbers(case: Case) -> tuple[Law, ...]:
    """Laws of which a refit of the rig's numbers leaves more than noise, each alone in the rig."""
    # A smaller pretension and slack are one thing in the wires of most motions, and gravity is one
    # with the joint's stiffness and rest angle: what is not there to be seen cannot be named.
    if case.true == case.bare:
        return case.laws
    command = case.recording.command.values

    def alone(law: Law) -> PlantDescription:
        added = (e for e in case.true.effects if e not in case.bare.effects)
        own = [e for e in added if e.id in law.ids and law.joint in ('', e.joint)]
        return replace(case.bare, effects=(*case.bare.effects, *own))

    plants = map(alone, case.laws) if len(case.laws) > 1 else [case.true] * len(case.laws)
    return tuple(
        law
        for law, plant in zip(case.laws, plants, strict=True)
        if left(case.bare, plant, command) >= 1.0
    )


def _named(law: Law) -> str:
    return f'{law.name}@{law.joint or "all"}'


def _left(case: Case) -> float:
    """What a refit leaves of the laws; NaN where another simulator has them."""
    if case.laws and case.true == case.bare:
        return math.nan
    return left(case.bare, case.true, case.recording.command.values) if case.laws else 0.0


def _evidence(effect: NamedEffect, case: Case) -> dict[str, float]:
    right = any(is_of(effect.id, effect.joint, law) for law in case.laws)
    rivals = float(len(effect.alternatives))
    return {**effect.evidence, 'rivals': rivals, 'right': float(right)}


def _error(true: float, found: Estimate) -> float:
    """Error over what the interval allows on that side."""
    allowed = found.high - found.value if true > found.value else found.value - found.low
    off = abs(true - found.value)
    return off / allowed if allowed > 0.0 else (0.0 if off == 0.0 else math.inf)


def _numbers(case: Case, said: Explanation) -> Iterator[tuple[float, Estimate]]:
    """True value of each number that is given, and its estimate."""
    for joint, estimates in said.parameters.items():
        true = case.true.joints[joint]
        for name, estimate in estimates.items():
            term = name.removeprefix('friction_profile_')
            terms = (*true.friction_profile, 0.0, 0.0, 0.0, 0.0)
            value = getattr(true, name) if term == name else terms[int(term) - 1]
            yield value, estimate
    for effect in said.effects:
        for spec in case.true.effects:
            if (spec.id, spec.joint) == (effect.id, effect.joint):
                for each in CATALOGUE[spec.id].parameters:
                    if each.comparable and each.name in effect.parameters:
                        yield spec.parameters[each.name], effect.parameters[each.name]


def failed(stratum: str, seed: int, error: BaseException) -> Row:
    """The row of a case that could not be explained: wrong in every respect."""
    wrong = Judgement(False, False, False, False, 0, False, math.nan)
    return Row(
        stratum=stratum,
        seed=seed,
        concealed=(),
        note=f'{type(error).__name__}: {error}',
        moved=math.nan,
        left=math.nan,
        verdict='FAILED',
        said=(),
        **vars(wrong),
    )


def table(rows: Sequence[Row]) -> str:
    """A line for each stratum, and one for all."""
    strata = dict.fromkeys(row.stratum for row in rows)
    lines = {f'`{name}`': [row for row in rows if row.stratum == name] for name in strata}
    lines['all'] = list(rows)
    shown = (table_row(name, *_cells(of_it)) for name, of_it in lines.items())
    return '\n'.join([table_head(*COLUMNS), *shown])


def _cells(rows: Sequence[Row]) -> tuple[str, ...]:
    def share(name: str, of: Sequence[Row] = rows) -> str:
        return f'{100.0 * np.mean([getattr(row, name) for row in of]):.0f} %' if of else '-'

    def second(name: str, quantile: float = 0.5) -> str:
        values = np.array([getattr(row, name) for row in rows])
        # What failed predicts nothing.
        values[np.isnan(values)] = np.inf
        return f'{np.quantile(values, quantile):.3g}'

    apart = [row for row in rows if row.is_told_apart]
    intervals = sum(row.intervals for row in rows)
    held = f'{100.0 * sum(row.held for row in rows) / intervals:.0f} %' if intervals else '-'
    seconds = [row.seconds for row in rows if not np.isnan(row.seconds)] or [math.nan]
    sizes = [row.set_size for row in rows if not np.isnan(row.set_size)] or [math.nan]
    return (
        str(len(rows)),
        str(len(apart)),
        share('first_of_told', apart),
        share('first'),
        share('place'),
        share('exact'),
        str(sum(row.false for row in rows)),
        share('in_set'),
        f'{np.mean(sizes):.1f}',
        held,
        second('nominal'),
        second('refitted'),
        second('augmented'),
        second('augmented', 0.8),
        f'{np.median(seconds):.1f}',
        f'{np.quantile(seconds, 0.95):.1f}',
    )


CaseKey = tuple[str, int]
"""Stratum and seed."""

SAME = 0.02
"""Relative difference of a misfit that two machines may have: fits end within a thousandth of their
cost, in which a misfit of twice the noise has a share of a hundredth."""


def rows_of(file: Path) -> dict[CaseKey, Row]:
    """Read a record; EndoscopeError for a line that is none of a row."""
    return {(row.stratum, row.seed): row for row in kept_rows(file, Row)}


def differences(before: Row, now: Row) -> Iterator[str]:
    """In what an explanation differs from the one on record: verdict, names, misfits, numbers."""
    for name in ('verdict', 'said'):
        was, is_ = getattr(before, name), getattr(now, name)
        if was != is_:
            yield f'{name} {_shown(was)} -> {_shown(is_)}'
    for name in ('nominal', 'refitted', 'augmented'):
        was, is_ = getattr(before, name), getattr(now, name)
        if not isclose(was, is_, rel_tol=SAME):
            yield f'second recording, {name}: {was:.3g} -> {is_:.3g}'
    if before.held != now.held or before.intervals != now.intervals:
        yield (
            f'intervals that hold: {before.held} of {before.intervals} -> '
            f'{now.held} of {now.intervals}'
        )


def _shown(value: str | tuple[str, ...]) -> str:
    return value if isinstance(value, str) else ' + '.join(value) or 'nothing'
