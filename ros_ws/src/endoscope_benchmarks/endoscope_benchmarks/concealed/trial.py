"""One case explained and judged, and the table of many."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from endoscope_benchmarks.concealed.judge import judged, statements
from endoscope_benchmarks.concealed.readings import misfit
from endoscope_benchmarks.concealed.strata import drawn_case
from endoscope_benchmarks.concealed.strength import left
from endoscope_explain.explain_recording import explain_recording

GOOD = 1.3
"""Rmse over noise up to which a second recording is predicted."""


@dataclass(frozen=True)
class Row:
    """What was concealed, what was said, and how far it is right.

    Attributes
    ----------
    stratum, seed
        Of the case.
    concealed : tuple of str
        Laws with their joints.
    note : str
        What is particular to the case.
    moved : float
        What the laws change, over the signal.
    left : float
        What a refit of the rig's numbers leaves of them, over noise.
    verdict : str
    said : tuple of str
        Names with their joints, most certain first.
    first, place, stage, exact, in_set : bool
    false : int
    set_size : float
        See `Judgement`.
    nominal, refitted, augmented : float
        Misfit of the second recording over noise, of the worst signal.
    seconds : float
        That explaining took.
    """

    stratum: str
    seed: int
    concealed: tuple[str, ...]
    note: str
    moved: float
    left: float
    verdict: str
    said: tuple[str, ...]
    first: bool
    place: bool
    stage: bool
    exact: bool
    false: int
    in_set: bool
    set_size: float
    nominal: float
    refitted: float
    augmented: float
    seconds: float

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
    """Draw a case, explain it on one core, and judge what is said.

    Parameters
    ----------
    stratum : str
    seed : int
    """
    case = drawn_case(stratum, seed)
    with threadpool_limits(1):
        begun = time.monotonic()
        said = explain_recording(
            case.recording, case.described, baseline=case.baseline, left_out=case.left_out, jobs=1
        )
        seconds = time.monotonic() - begun
    names = statements(said)
    judgement = judged(case.laws, names, case.also)
    nominal, refitted, augmented = (
        misfit(plant, case.second, case.described.sensors)
        for plant in (said.nominal, said.refitted, said.augmented)
    )
    return Row(
        stratum,
        seed,
        tuple(f'{law.name}@{law.joint or "all"}' for law in case.laws),
        case.note,
        case.moved,
        left(case.bare, case.true, case.recording.command.values) if case.laws else 0.0,
        str(said.verdict),
        tuple(f'{each.name}@{each.joint}' for each in names),
        nominal=nominal,
        refitted=refitted,
        augmented=augmented,
        seconds=seconds,
        **vars(judgement),
    )


def failed(stratum: str, seed: int, error: BaseException) -> Row:
    """The row of a case that could not be explained: wrong in every respect."""
    nan = float('nan')
    return Row(
        stratum, seed, (), f'{type(error).__name__}: {error}', nan, nan, 'FAILED', (), False, False,
        False, False, 0, False, nan, nan, nan, nan, nan,
    )  # fmt: skip


def table(rows: Sequence[Row]) -> str:
    """A line for each stratum."""
    above = (
        f'{"":17s}{"":>6s}{"named":>7s}{"right":>7s}{"right":>7s}{"exact":>7s}{"false":>7s}'
        f'{"in set":>8s}{"names":>7s}   second recording over noise: median (within 1.3)   '
        f'{"seconds":>9s}'
    )
    heads = (
        f'{"stratum":17s}{"cases":>6s}{"first":>7s}{"place":>7s}{"stage":>7s}{"set":>7s}'
        f'{"names":>7s}{"":>8s}{"a set":>7s}   {"nominal":>15s}{"refitted":>15s}'
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

    seconds = [row.seconds for row in rows if not np.isnan(row.seconds)] or [float('nan')]
    sizes = [row.set_size for row in rows if not np.isnan(row.set_size)] or [float('nan')]
    return (
        f'{stratum:17s}{len(rows):6d}{share("first"):>7s}{share("place"):>7s}{share("stage"):>7s}'
        f'{share("exact"):>7s}{sum(row.false for row in rows):7d}{share("in_set"):>8s}'
        f'{np.mean(sizes):7.1f}   {second("nominal"):>15s}{second("refitted"):>15s}'
        f'{second("augmented"):>15s}   {np.median(seconds):9.1f}{np.quantile(seconds, 0.95):7.1f}'
    )
