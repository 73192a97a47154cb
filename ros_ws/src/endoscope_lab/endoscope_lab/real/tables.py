"""`endoscope bench real`: one physics for real recordings of a flexible endoscope."""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from threadpoolctl import threadpool_limits

from endoscope_core.atomic_output import write_text
from endoscope_core.physics.effects import CATALOGUE, KNOWN
from endoscope_explain.decide.conclusions import NOMINAL_UNITS
from endoscope_explain.report.numbers import PLANTS as LABEL
from endoscope_explain.report.numbers import digits, in_degrees
from endoscope_explain.search.left_out import chance
from endoscope_lab.bench import report, table_head, table_row
from endoscope_lab.identification.family_fit import FITTED_CYCLES
from endoscope_lab.papers.real_recordings import real_recordings
from endoscope_lab.real import prandtl_ishlinskii
from endoscope_lab.real.explained import (
    Number,
    State,
    Tubes,
    explained_state,
    explained_tubes,
    numbers,
    unknown_tubes,
)
from endoscope_lab.real.rig import Told
from endoscope_lab.real.takes import between_cycles, require_recordings
from endoscope_lab.still_pictures import INK, STYLE, svg, thinned
from endoscope_pages import html_table, render_page

PAGE = 'real.html'


def run(args: argparse.Namespace) -> int:
    """Print the tables and write the page."""
    require_recordings(args.folder)
    # A fit's matrices are tall and narrow: threads would only wait for each other.
    with threadpool_limits(1, 'blas'):
        tubes = explained_tubes(args.folder, args.jobs, report)
        state = explained_state(args.folder, tubes, args.jobs, report)
        unknown = unknown_tubes(args.folder, tubes, report)
        box = prandtl_ishlinskii.left(real_recordings(args.folder), FITTED_CYCLES)
        parts = sections(
            tubes,
            numbers(tubes.explained, args.jobs),
            box,
            state,
            numbers([state.fit], args.jobs),
            unknown,
        )
    print(as_text(parts))
    picture = five_loops(tubes)
    write_text(args.out, page(parts, picture, in_short(tubes, box)))
    write_text(args.out.with_suffix('.svg'), picture)
    print(f'\nPage: {args.out}')
    return 0


PLANTS = ('nominal', 'refitted', 'augmented')
LINE = {
    'measured': ('-', INK),
    'nominal': ('-', '#c2571a'),
    'refitted': ('--', '#2f6fb7'),
    'augmented': ('-.', '#1a8a66'),
}
UNITS = {
    **NOMINAL_UNITS,
    **{f'{e.id}.{p.name}': p.unit for e in CATALOGUE.values() for p in e.parameters},
}

Rows = list[tuple[str, ...]]


BETWEEN = ('two cycles differ by', 'angle, times that')


def rmse_rows(told: Iterable[Told], extra: Mapping[str, float] | None = None) -> Rows:
    """Rmse under each plant: deg of angle / N of the wires; then what two cycles differ by."""
    rows = []
    for one in told:
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
    """A number with its interval for each recording; angles are in degrees."""
    rows = []
    for name, found in numbers.items():
        shown, unit, factor = in_degrees(name, UNITS.get(name, ''))
        cells = []
        for one in found:
            value, low, high = (digits(factor * v, 3) for v in one or (np.nan,) * 3)
            cells.append('-' if one is None else f'{value} ({low} to {high})')
        rows.append((f'{shown} ({unit})' if unit else shown, *cells))
    return rows


def worth_rows(tubes: Tubes) -> Rows:
    """What one term more is worth to all tubes, and to each by what the others say of it."""
    rows = []
    for number, level in enumerate(tubes.levels, 1):
        for one in level.found:
            gained = one.foretold - level.parent.foretold
            added = ', '.join(t.id for t in one.terms) or 'other numbers'
            beside = [f'{each:+.0f}' for each in gained]
            rows.append(
                (str(number), added, f'{level.gain(one):+.0f}', *beside, f'{chance(gained):.3f}')
            )
    return rows


UNKNOWN = (
    "The instrument is that of the five tubes. A tube's own numbers, and what scatters from tube "
    'to tube, were fitted again on 1.3 cycles; the rest is judged.'
)
WORTH = (
    'Nats of the evidence of all tubes, and of each tube where it was left out: the others say '
    'what the instrument is, what scatters is refitted to three quarters of its blocks, the fourth '
    'is judged. What carries best is taken; chance of gains like these where it is worth nothing.'
)

Section = tuple[str, str, tuple[str, ...], Rows, Sequence[Told]]
"""Title, words, header and rows of a table, and recordings that are drawn; where some are, the
fourth column's name is that of the last plant."""


def sections(
    tubes: Tubes,
    numbers: Mapping[str, Sequence[Number | None]],
    black_box: Mapping[str, float],
    state: State,
    of_state: Mapping[str, Sequence[Number | None]],
    unknown: Sequence[Told],
) -> list[Section]:
    """All that is said of the recordings, in order."""
    last = 'explained' if tubes.named else f'with {" and ".join(tubes.effects)}, not named'
    plain = ('recording', 'described', 'refitted', last, *BETWEEN)
    names = [one.take.name for one in tubes.told]
    first = [replace(one, begin=0.0, end=one.begin) for one in tubes.told]
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
            'What one effect more is worth',
            WORTH,
            ('step', 'effects', 'all', *names, 'chance'),
            worth_rows(tubes),
            (),
        ),
        ('Tubes, 1.3 cycles', 'They were fitted.', plain, rmse_rows(first), ()),
        (
            'Tubes, the rest',
            'It was predicted.',
            header,
            rmse_rows(tubes.told, black_box),
            tubes.told,
        ),
        (
            'Another state of the rig, numbers',
            f"The instrument is the tubes'. Nats lost without: {needed}. Alone it names {alone}.",
            ('number', state.told[0].take.name),
            number_rows(of_state),
            (),
        ),
        (
            'Another state of the rig',
            'The first was fitted, others are predicted; of the last, pretension was refitted.',
            plain,
            rmse_rows(state.told),
            state.told,
        ),
        (
            'Unknown tubes',
            UNKNOWN,
            plain,
            rmse_rows(unknown),
            unknown,
        ),
    ]


def as_text(parts: Iterable[Section]) -> str:
    """The tables as they are printed."""
    return '\n\n'.join(
        '\n'.join([title, words, '', table_head(*header), *(table_row(*row) for row in rows)])
        for title, words, header, rows, _ in parts
    )


def in_short(tubes: Tubes, box: Mapping[str, float]) -> dict[str, object]:
    """What the page says first: mean rms of the angle that was not fitted, deg."""

    def mean(radians: Iterable[float]) -> float:
        return float(np.rad2deg(np.mean([*radians])))

    between = mean(between_cycles(one.take)[0] for one in tubes.told)
    after = mean(one.left('augmented')[0] for one in tubes.told)
    return {
        'named': tubes.named,
        'names': ' and '.join(KNOWN[e].physics.rstrip('.') for e in tubes.effects),
        'before': f'{mean(one.left("refitted")[0] for one in tubes.told):.2f}',
        'after': f'{after:.2f}',
        'between': f'{between:.2f}',
        'ratio': f'{after / between:.2f}',
        'box': f'{mean(box.values()):.2f}',
    }


def five_loops(tubes: Tubes) -> str:
    """The last loop of each tube as measured, without and with what was missing (SVG)."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 2.9), layout='constrained')
        axes = figure.subplots(1, len(tubes.told), sharey=True)
        for axis, told in zip(axes, tubes.told, strict=True):
            channel = told.plants['refitted'].model.observation.channels[-1]
            seen = channel.time >= channel.time[-1] - told.take.cycle_s
            command = np.rad2deg(np.interp(channel.time, told.take.time, told.take.command))
            for label, values, colour, width in (
                ('measured', channel.value, '#b8c1cc', 4.0),
                ('simulated', told.plants['refitted'].predicted()[-1], LINE['nominal'][1], 1.2),
                (
                    'simulated, with what was missing',
                    told.plants['augmented'].predicted()[-1],
                    LINE['augmented'][1],
                    1.2,
                ),
            ):
                axis.plot(
                    command[seen], np.rad2deg(values[seen]), color=colour, lw=width, label=label
                )
            axis.set_title(f'tube bent by {told.take.name} deg')
            axis.set_xlabel('command (deg)')
        axes[0].set_ylabel('angle of the tip (deg)')
        handles = axes[0].get_legend_handles_labels()
        figure.legend(*handles, loc='outside lower center', ncols=3)
        return svg(figure)


def page(parts: Sequence[Section], hero: str, story: Mapping[str, object]) -> str:
    """A page that needs no other file."""
    shown = [
        (title, words, html_table(header, rows, words=1), [loops(one, header[3]) for one in told])
        for title, words, header, rows, told in parts
    ]
    return render_page(
        'endoscope_lab', 'real/templates/real.html.j2', sections=shown, hero=hero, story=story
    )


def loops(told: Told, last: str) -> str:
    """Angle and tensions over the command, measured and as each plant predicts them (SVG)."""
    take = told.take
    channels = told.plants['nominal'].model.observation.channels
    curves = {name: told.plants[name].predicted() for name in PLANTS}
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 3.3), layout='constrained')
        axes = figure.subplots(1, len(channels), squeeze=False)[0]
        order = [len(channels) - 1, *range(len(channels) - 1)]
        for axis, k in zip(axes, order, strict=True):
            channel = channels[k]
            seen = channel.time >= told.begin
            factor = np.rad2deg(1.0) if channel.quantity == 'bending' else 1.0
            command = np.rad2deg(np.interp(channel.time, take.time, take.command))
            for name, values in (
                ('measured', channel.value),
                *((n, c[k]) for n, c in curves.items()),
            ):
                axis.plot(
                    *thinned(command[seen], factor * values[seen]),
                    LINE[name][0],
                    color=LINE[name][1],
                    lw=2.2 if name == 'measured' else 1.0,
                    zorder=1 if name == 'measured' else 2,
                    label=last if name == 'augmented' else LABEL.get(name, name),
                )
            unit = 'deg' if channel.quantity == 'bending' else 'N'
            axis.set_title(f'{take.name}: {channel.signal.partition(":")[2]} ({unit})')
            axis.set_xlabel('command (deg)')
        figure.legend(
            *axes[0].get_legend_handles_labels(), loc='outside upper right', ncols=4, fontsize=8
        )
        return svg(figure)
