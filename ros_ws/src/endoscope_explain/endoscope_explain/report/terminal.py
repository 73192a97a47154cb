"""What a person reads in the terminal: the finding, its place, numbers, fits and the next step."""

from collections.abc import Sequence

from endoscope_explain.case import ExplainedCase
from endoscope_explain.explanation import Verdict
from endoscope_explain.report.numbers import PLANTS, digits, judged, numbers_of, shown
from endoscope_explain.report.sentences import (
    differing,
    how_sure,
    label,
    next_step,
    not_shown,
    physics_of,
    plain,
    reservations,
    verdict_sentence,
    where,
)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return rows below their heads in columns of even width."""
    lines = [head, *rows]
    widths = [max(len(row[k]) for row in lines) for k in range(len(head))]
    return '\n'.join(
        '  '.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in lines
    )


def told(case: ExplainedCase) -> str:
    """Say what was found, in lines of which the first one is the verdict's sentence."""
    lines = [verdict_sentence(case), *reservations(case)]
    for effect in case.effects:
        said = ' '.join(filter(None, (physics_of(effect), how_sure(effect))))
        lines.append(f'  {label(effect)}: {said}')
        lines += [f'    {one}' for one in numbers_of(effect)]
    if case.rest is Verdict.PARAMETERS_DIFFER:
        for (joint, name), e in differing(case).items():
            lines.append(f'  {joint}: {shown(name, e)}')
    lines += [f'  {one}' for one in not_shown(case)]
    term = case.explanation.unknown
    if term is not None and term.helps:
        lines.append(f'  It explains {100 * term.explained:.0f} % of the excess misfit.')
    lines += [f'Where: {where(place)}.' for place in case.places]
    fits = fits_table(case)
    if fits:
        head, rows = fits
        lines += table(('rmse / noise', *head[1:]), rows).splitlines()
    lines.append(f'Next: {next_step(case)}')
    return '\n'.join(lines)


def fits_table(case: ExplainedCase) -> tuple[tuple[str, ...], list[tuple[str, ...]]] | None:
    """Misfit over noise of each signal by each plant: heads and rows; None where none was made."""
    plants = {name: fits for name, fits in judged(case, case.ladder).items() if name in PLANTS}
    if not plants.get('nominal'):
        return None
    rows = [
        (plain(signal), *(digits(fits[signal].ratio) for fits in plants.values()))
        for signal in plants['nominal']
    ]
    return ('signal', *(PLANTS[name] for name in plants)), rows
