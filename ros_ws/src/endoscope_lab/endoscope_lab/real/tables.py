"""`endoscope bench real`: one plant for real recordings of a flexible endoscope."""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from endoscope_core.atomic_output import write_text
from endoscope_core.physics.effects import CATALOGUE, KNOWN
from endoscope_explain.fit.intervals import NOMINAL_UNITS
from endoscope_explain.report.numbers import digits, in_degrees
from endoscope_explain.search.left_out import chance
from endoscope_explain.search.levels import Level
from endoscope_lab.bench import report, table_head, table_row
from endoscope_lab.papers.real_recordings import left_of_the_rest, real_recordings
from endoscope_lab.real import prandtl_ishlinskii
from endoscope_lab.real.alone import Alone, Withheld, each_alone, name_withheld
from endoscope_lab.real.explained import (
    ExplainedTubes,
    Number,
    OtherState,
    explained_state,
    explained_tubes,
    numbers,
    unknown_tubes,
)
from endoscope_lab.real.pictures import PLANTS, five_loops, function_over_angle, loops
from endoscope_lab.real.pieces import Late, TakenOut, late_cells, taken_out
from endoscope_lab.real.rig import JudgedTake
from endoscope_lab.real.takes import TUBES, between_cycles, require_recordings
from endoscope_pages import html_table, render_page

PAGE = 'real.html'


def run(args: argparse.Namespace) -> int:
    """Print the tables and write the page."""
    require_recordings(args.folder)
    # The matrices of a fit are tall and narrow, so that threads would only wait for each other.
    with threadpool_limits(1, 'blas'):
        tubes = explained_tubes(args.folder, args.jobs, report)
        state = explained_state(args.folder, tubes, args.jobs, report)
        unknown = unknown_tubes(args.folder, tubes, report)
        rest = left_of_the_rest(real_recordings(args.folder), prandtl_ishlinskii.fitted)
        box = {str(bend): judged for bend, (_, judged) in rest.items()}
        parts = sections(
            tubes,
            numbers(tubes.explained, args.jobs),
            box,
            state,
            numbers([state.fit], args.jobs),
            unknown,
        )
        drawn: dict[str, str] = {}
        if args.thorough:
            parts += thorough_sections(
                each_alone(args.folder, args.jobs, report),
                withheld := name_withheld(args.folder, args.jobs, report),
                late_cells(args.folder, args.jobs, report),
                taken_out(args.folder, args.jobs, report),
            )
            drawn[WITHHELD] = function_over_angle(withheld)
            beside = args.out.with_name(f'{args.out.stem}_function.svg')
            write_text(beside, drawn[WITHHELD])
    print(as_text(parts))
    picture = five_loops(tubes)
    write_text(args.out, page(parts, picture, in_short(tubes, box), drawn))
    write_text(args.out.with_suffix('.svg'), picture)
    print(f'\nPage: {args.out}')
    return 0


UNITS = {
    **NOMINAL_UNITS,
    **{f'{e.id}.{p.name}': p.unit for e in CATALOGUE.values() for p in e.parameters},
}

Rows = list[tuple[str, ...]]


BETWEEN = ('two cycles differ by', 'angle, times that')


def rmse_rows(takes: Iterable[JudgedTake], extra: Mapping[str, float] | None = None) -> Rows:
    """Rmse of each plant (deg of angle / N of the wires), then the difference of two cycles."""
    rows = []
    for one in takes:
        reference = between_cycles(one.take)
        explained = one.left('augmented')
        ratio = explained[0] / reference[0]
        row = [one.take.name, *(_rms(one.left(name)) for name in PLANTS), _rms(reference)]
        row.append('-' if np.isnan(ratio) else f'{ratio:.1f}')
        if extra is not None:
            row.append(f'{np.rad2deg(extra[one.take.name]):.2f}')
        rows.append(tuple(row))
    return rows


def _rms(values: Sequence[float]) -> str:
    if np.isnan(values[0]):
        return '-'
    return ' / '.join([f'{np.rad2deg(values[0]):.2f}', *(f'{v:.2f}' for v in values[1:])])


def number_rows(numbers: Mapping[str, Sequence[Number | None]]) -> Rows:
    """Parameters with their intervals for each recording; angles are in degrees."""
    rows = []
    for name, found in numbers.items():
        shown, unit, factor = in_degrees(name, UNITS.get(name, ''))
        cells = []
        for one in found:
            value, low, high = (digits(factor * v, 3) for v in one or (np.nan,) * 3)
            cells.append('-' if one is None else f'{value} ({low} to {high})')
        rows.append((f'{shown} ({unit})' if unit else shown, *cells))
    return rows


def worth_rows(levels: Sequence[Level]) -> Rows:
    """Gain of one more term for all tubes, and for each tube by a fit to the others."""
    rows = []
    for number, level in enumerate(levels, 1):
        for one in level.found:
            gained = one.foretold - level.parent.foretold
            added = ', '.join(t.id for t in one.terms) or 'other numbers'
            beside = [f'{each:+.0f}' for each in gained]
            rows.append(
                (str(number), added, f'{level.gain(one):+.0f}', *beside, f'{chance(gained):.3f}')
            )
    return rows


UNKNOWN = (
    "The instrument is that of the five tubes. A tube's own parameters, and those that scatter "
    'from tube to tube, were fitted again on 1.3 cycles; the rest is judged.'
)
WORTH = (
    'Gain of evidence in nats, for all tubes and for each tube when it is left out: the instrument '
    'is that of the other tubes, parameters that scatter are refitted to three quarters of its '
    'blocks, and the fourth is judged. The term that generalises best is taken. Last column: '
    'chance of such gains from a term without effect.'
)

WITHHELD = 'The name withheld'
NUMBERS_OF_PIECES = (
    'If the component is named: its parameter as found, and in the whole plant; otherwise the name '
    'given instead. In parentheses: loss of evidence in nats.'
)

Section = tuple[str, str, tuple[str, ...], Rows, Sequence[JudgedTake]]
"""Title, words, header and rows of a table, and recordings that are drawn; where some are, the
fourth column's name is that of the last plant."""


def sections(
    tubes: ExplainedTubes,
    numbers: Mapping[str, Sequence[Number | None]],
    black_box: Mapping[str, float],
    state: OtherState,
    of_state: Mapping[str, Sequence[Number | None]],
    unknown: Sequence[JudgedTake],
) -> list[Section]:
    """All sections about the recordings, in order."""
    last = 'explained' if tubes.named else f'with {" and ".join(tubes.effects)}, not named'
    plain = ('recording', 'described', 'refitted', last, *BETWEEN)
    names = [one.take.name for one in tubes.takes]
    first = [replace(one, begin=0.0, end=one.begin) for one in tubes.takes]
    needed = ', '.join(f'{e} {gain:.0f}' for e, gain in state.needed.items()) or 'nothing'
    alone = '; '.join(state.alone) or 'nothing'
    header = (*plain, 'Prandtl-Ishlinskii, angle')
    return [
        (
            'Tubes, numbers',
            f'{"; ".join(tubes.search)}. 90 % intervals.',
            ('number', *names),
            number_rows(numbers),
            (),
        ),
        (
            'Gain of one more effect',
            WORTH,
            ('step', 'effects', 'all', *names, 'chance'),
            worth_rows(tubes.levels),
            (),
        ),
        ('Tubes, 1.3 cycles', 'They were fitted.', plain, rmse_rows(first), ()),
        (
            'Tubes, the rest',
            'It was predicted.',
            header,
            rmse_rows(tubes.takes, black_box),
            tubes.takes,
        ),
        (
            'Another state of the rig, numbers',
            f"The instrument is the tubes'. Nats lost without: {needed}. Named alone: {alone}.",
            ('number', state.takes[0].take.name),
            number_rows(of_state),
            (),
        ),
        (
            'Another state of the rig',
            'The first was fitted, others are predicted; of the last, pretension was refitted.',
            plain,
            rmse_rows(state.takes),
            state.takes,
        ),
        (
            'Unknown tubes',
            UNKNOWN,
            plain,
            rmse_rows(unknown),
            unknown,
        ),
    ]


def thorough_sections(
    alone: Sequence[Alone], withheld: Withheld, late: Sequence[Late], out: Sequence[TakenOut]
) -> list[Section]:
    """Sections on each tube alone, the name withheld, late cells, and removed components."""
    pieces = {one.piece: [o for o in out if o.piece == one.piece] for one in out}
    first = sum(one.named[:1] == (one.piece,) for one in out)
    return [
        (
            'Each tube alone',
            'Whole loops. Dismissed: more evidence, but no prediction of repeated branches.',
            ('tube', 'named', 'nats', 'chance', 'dismissed'),
            [
                (
                    a.tube,
                    ', '.join(a.named) or 'nothing',
                    f'{a.gain:+.0f}',
                    f'{a.p_value:.3f}',
                    ', '.join(a.dismissed) or '-',
                )
                for a in alone
            ],
            (),
        ),
        (
            WITHHELD,
            f'Whole loops of all tubes. Named: {", ".join(withheld.named) or "nothing"}.',
            ('step', 'effects', 'all', *TUBES, 'chance'),
            worth_rows(withheld.levels),
            (),
        ),
        (
            'Which cell is late, and how',
            'Each tube fitted to its angle and one cell alone.',
            ('tube', 'cell', 'by a delay, ms', 'by a lag, ms', 'nats for the delay'),
            [
                (
                    each.tube,
                    each.cell.lstrip('_'),
                    f'{1e3 * each.delay_s:.0f}',
                    f'{1e3 * each.lag_s:.0f}',
                    f'{each.for_delay:+.0f}',
                )
                for each in late
            ],
            (),
        ),
        (
            'Components removed',
            f'Whole loops. Named first: {first} of {len(out)}. {NUMBERS_OF_PIECES}',
            ('component', *TUBES),
            [(piece, *map(_taken_out, ones)) for piece, ones in pieces.items()],
            (),
        ),
    ]


def _taken_out(one: TakenOut) -> str:
    found, whole = one.number
    if one.piece in one.named:
        beside = f', after {one.named[0]}' if one.named[0] != one.piece else ''
        result = f'{digits(found, 3)}, {digits(whole, 3)}{beside}'
    else:
        result = one.named[0] if one.named else 'nothing'
    return f'{result} ({one.costs:.0f})'


def as_text(parts: Iterable[Section]) -> str:
    """The tables as they are printed."""
    return '\n\n'.join(
        '\n'.join([title, words, '', table_head(*header), *(table_row(*row) for row in rows)])
        for title, words, header, rows, _ in parts
    )


def in_short(tubes: ExplainedTubes, box: Mapping[str, float]) -> dict[str, object]:
    """Summary of the page: mean rms of the angle that was not fitted, deg."""

    def mean(radians: Iterable[float]) -> float:
        return float(np.rad2deg(np.mean([*radians])))

    between = mean(between_cycles(one.take)[0] for one in tubes.takes)
    after = mean(one.left('augmented')[0] for one in tubes.takes)
    return {
        'named': tubes.named,
        'names': ' and '.join(KNOWN[e].physics.rstrip('.') for e in tubes.effects),
        'before': f'{mean(one.left("refitted")[0] for one in tubes.takes):.2f}',
        'after': f'{after:.2f}',
        'between': f'{between:.2f}',
        'ratio': f'{after / between:.2f}',
        'box': f'{mean(box.values()):.2f}',
    }


def page(
    parts: Sequence[Section], hero: str, story: Mapping[str, object], drawn: Mapping[str, str]
) -> str:
    """A page that needs no other file."""
    shown = [
        (
            title,
            words,
            html_table(header, rows, words=1),
            [
                *(loops(one, header[3]) for one in takes),
                *([drawn[title]] if title in drawn else []),
            ],
        )
        for title, words, header, rows, takes in parts
    ]
    return render_page(
        'endoscope_lab', 'real/templates/real.html.j2', sections=shown, hero=hero, story=story
    )
