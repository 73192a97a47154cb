"""The bench's tables as text."""

from collections.abc import Sequence

from endoscope_explain.benchmark.figures_of_merit import (
    Figure,
    calibration_curve,
    confusions,
    peers_named_first,
)
from endoscope_explain.benchmark.outcome import Outcome


def progress_line(done: int, total: int, outcome: Outcome) -> str:
    """Return one line on a finished case.

    Parameters
    ----------
    done, total : int
    outcome : Outcome
    """
    truth = ' + '.join(item['id'] for item in outcome.truth['concealed']) or 'nothing'
    named = ' + '.join(f'{e.id} ({e.probability:.2f})' for e in outcome.named) or '-'
    return (
        f'{done:4d}/{total} {outcome.stratum:8s} {outcome.motion:13s} {outcome.runtime_s:5.0f} s  '
        f'{truth}  ->  {outcome.verdict}: {named}'
    )


def table(figures: Sequence[Figure]) -> str:
    """Return the table of figures."""
    width = max(len(f.name) for f in figures)
    lines = []
    for f in figures:
        mark = {True: 'reached', False: 'MISSED', None: ''}[f.reached]
        lines.append(f'{f.name:{width}s}  {f.value:24s}  {f.wanted:14s}  {mark}'.rstrip())
    return '\n'.join(lines)


def confusion_table(outcomes: Sequence[Outcome]) -> str:
    """Return what was named for each single concealed effect, most cases first."""
    counts = confusions(outcomes)
    lines = []
    for concealed in sorted({c for c, _ in counts}):
        row = {named: n for (c, named), n in counts.items() if c == concealed}
        right = row.pop(concealed, 0)
        others = ', '.join(f'{n} {k}' for k, n in sorted(row.items(), key=lambda i: -i[1]))
        lines.append(f'{concealed:22s} {right:3d} of {right + sum(row.values()):3d}  {others}')
    return '\n'.join(line.rstrip() for line in lines)


def calibration_table(outcomes: Sequence[Outcome]) -> str:
    """Return the calibration curve."""
    return '\n'.join(
        f'{b.low:.2f} < p <= {b.high:.2f}: {b.count:4d} reported with {b.mean:.3f} on average, '
        f'{b.right:.3f} right'
        for b in calibration_curve(outcomes)
    )


def peers_table(outcomes: Sequence[Outcome]) -> str:
    """Return how often each peer named the concealed effect first."""
    return '\n'.join(
        f'{name:20s} {right:3d} of {asked}'
        for name, (right, asked) in peers_named_first(outcomes).items()
    )
