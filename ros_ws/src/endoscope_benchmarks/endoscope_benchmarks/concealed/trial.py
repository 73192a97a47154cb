"""One case explained and judged, and the table of many."""

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from endoscope_benchmarks.concealed.case import Case
from endoscope_benchmarks.concealed.judge import Judgement, is_of, judged, statements
from endoscope_benchmarks.concealed.readings import misfit
from endoscope_benchmarks.concealed.strata import drawn_case
from endoscope_benchmarks.concealed.strength import left
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.criteria import REACH
from endoscope_explain.explain_recording import explain_recording
from endoscope_explain.explanation import Estimate, Explanation

GOOD = 1.3
"""Rmse over noise up to which a second recording is predicted."""


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
    # gain of the truth over that of the best term; NaN where it is not one
    truth_share: float = math.nan
    shares: tuple[float, ...] = ()  # the same of each name that was tried, the best first
    # What is left over what rigs of another form leave, of the worst joint.
    beyond_form: float = math.nan
    # Error of each number over what its interval would allow on that side with a `REACH` of one.
    errors: tuple[float, ...] = ()

    def line(self) -> str:
        """The case in one line."""
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
    said, seconds = explanation_of(case)
    names = statements(said)
    errors = [_error(*number) for number in _numbers(case, said)]
    judgement = judged(case.laws, names, case.also)
    law = case.laws[0] if len(case.laws) == 1 else None
    where = (law.joint if law else '') or (names[0].joint if names else '')
    shares = _shares(said, where)
    true = [share for name, share in shares.items() if law and is_of(name, where, law)]
    nominal, refitted, augmented = (
        misfit(plant, case.second, case.described.sensors)
        for plant in (said.nominal, said.refitted, said.augmented)
    )
    return Row(
        stratum=case.stratum,
        seed=case.seed,
        concealed=tuple(f'{law.name}@{law.joint or "all"}' for law in case.laws),
        note=case.note,
        moved=case.moved,
        left=left(case.bare, case.true, case.recording.command.values) if case.laws else 0.0,
        verdict=str(said.verdict),
        said=tuple(f'{each.name}@{each.joint}' for each in names),
        held=sum(error <= 1.0 for error in errors),
        intervals=len(errors),
        nominal=nominal,
        refitted=refitted,
        augmented=augmented,
        seconds=seconds,
        truth_share=max(true, default=0.0) if law and shares else math.nan,
        shares=tuple(sorted(shares.values(), reverse=True)),
        beyond_form=said.beyond_form,
        errors=tuple(REACH * error for error in errors),
        **vars(judgement),
    )


def _shares(said: Explanation, joint: str) -> dict[str, float]:
    """What each name on a joint gains as the only term, over what the best one gains."""
    gains: dict[str, float] = {}
    for each in said.candidates:
        if each.joint == joint and len(each.effects) == 1:
            gains[each.effects[0]] = max(gains.get(each.effects[0], 0.0), -each.score)
    best = max(gains.values(), default=0.0)
    return {name: gain / best for name, gain in gains.items()} if best > 0.0 else {}


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
    """A line for each stratum."""
    above = (
        f'{"":17s}{"":>6s}{"named":>7s}{"right":>7s}{"right":>7s}{"exact":>7s}{"false":>7s}'
        f'{"in set":>8s}{"names":>7s}{"inter-":>8s}   '
        f'{"second recording over noise: median (within 1.3)":48s}{"seconds":>9s}'
    )
    heads = (
        f'{"stratum":17s}{"cases":>6s}{"first":>7s}{"place":>7s}{"stage":>7s}{"set":>7s}'
        f'{"names":>7s}{"":>8s}{"a set":>7s}{"vals":>8s}   {"nominal":>15s}{"refitted":>15s}'
        f'{"augmented":>15s}   {"median":>9s}{"95th":>7s}'
    )
    lines = [above, heads]
    for stratum in dict.fromkeys(row.stratum for row in rows):
        lines.append(_line(stratum, [row for row in rows if row.stratum == stratum]))
    return '\n'.join(lines)


def _line(stratum: str, rows: Sequence[Row]) -> str:
    def share(name: str) -> str:
        return f'{100.0 * np.mean([getattr(row, name) for row in rows]):.0f} %'

    def second(name: str) -> str:
        values = np.array([getattr(row, name) for row in rows])
        # What failed predicts nothing.
        values[np.isnan(values)] = np.inf
        return f'{np.median(values):.2f} ({100.0 * np.mean(values <= GOOD):.0f} %)'

    intervals = sum(row.intervals for row in rows)
    held = f'{100.0 * sum(row.held for row in rows) / intervals:.0f} %' if intervals else '-'
    seconds = [row.seconds for row in rows if not np.isnan(row.seconds)] or [math.nan]
    sizes = [row.set_size for row in rows if not np.isnan(row.set_size)] or [math.nan]
    return (
        f'{stratum:17s}{len(rows):6d}{share("first"):>7s}{share("place"):>7s}{share("stage"):>7s}'
        f'{share("exact"):>7s}{sum(row.false for row in rows):7d}{share("in_set"):>8s}'
        f'{np.mean(sizes):7.1f}{held:>8s}   '
        f'{second("nominal"):>15s}{second("refitted"):>15s}{second("augmented"):>15s}   '
        f'{np.median(seconds):9.1f}{np.quantile(seconds, 0.95):7.1f}'
    )
