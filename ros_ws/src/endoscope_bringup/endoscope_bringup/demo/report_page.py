"""The demonstration's report as one self-contained page: plots, and sentences that follow."""

from collections.abc import Sequence
from functools import partial
from importlib.resources import files

import numpy as np

from endoscope_bringup.demo.procedure import (
    MEANING,
    MOTION_TITLE,
    MOTIONS,
    TABLE_5,
    CalibrationFacts,
    Method,
)
from endoscope_bringup.demo.results import (
    BACKLASH,
    LARGEST,
    RMSE,
    Array,
    CalibrationOutcome,
    DemoResults,
    TableRow,
    TrackingRun,
    mean_over_joints,
    of_figure,
    ranking,
    table_rows,
    values_of,
)
from endoscope_core.metrics import tracking_rmse
from endoscope_core.signals import motion_by_name
from endoscope_nodes.names import JOINTS
from endoscope_pages import Curve, Plot, figure_html, html_table, render_page

COLOUR = {
    Method.NONE: 'curve-2',
    Method.BOUC_WEN: 'curve-1',
    Method.INVERSE: 'curve-4',
}
"""Of what the tip did by each method, by its name in look.css."""

LIMITS_DEG = (-70.0, 70.0)
_COURSE = partial(Plot, x_label='time (s)')
_LOOP = partial(Plot, x_label='asked for (deg)', loop=True, diagonal=True)
_SQUARE = partial(_LOOP, columns=6, square=True, range_x=LIMITS_DEG, range_y=LIMITS_DEG)
_DASHES = (6.0, 4.0)
LEAST_CUT_DEG = 0.1


def loops_figure(results: DemoResults, tube: str, motion: str, best: Method) -> str:
    """Actual against desired angle of each joint, uncompensated and by one method."""
    runs = [results.run(tube, motion, method) for method in dict.fromkeys((Method.NONE, best))]
    plots = []
    for column, joint in enumerate(JOINTS):
        curves = [_loop(str(r.method), r, column, COLOUR[r.method], r.time) for r in runs]
        plots.append(_SQUARE(f"{joint}, tip's angle (deg)", curves=tuple(curves)))
    return figure_html(plots, _loops_in_words(results, tube, motion, best))


def tracking_figure(results: DemoResults, tube: str, motion: str, methods: list[Method]) -> str:
    """Angle over time beside what was asked for, a row for each method, and below the errors."""
    runs = [results.run(tube, motion, method) for method in methods]
    plots = [_track(run, column, joint) for run in runs for column, joint in enumerate(JOINTS)]
    for column, joint in enumerate(JOINTS):
        title = f'{joint}, errors of the compensated runs (deg)'
        errors = [
            Curve(str(run.method), run.time, run.error_deg[:, column], COLOUR[run.method])
            for run in runs
            if run.method is not Method.NONE
        ]
        plots.append(_COURSE(title, curves=tuple(errors), columns=6, height=130))
    return figure_html(plots, _tracking_in_words(results, tube, motion, methods))


def _track(run: TrackingRun, column: int, joint: str) -> Plot:
    name, desired, actual = 'asked for', run.desired_deg[:, column], run.actual_deg[:, column]
    asked = Curve(name, run.time, desired, 'wanted', dash=_DASHES, width=1.6)
    tip = Curve(str(run.method), run.time, actual, COLOUR[run.method], to=name)
    both = (tip, asked)
    return _COURSE(f'{joint} (deg)', curves=both, columns=6, height=110, range_y=LIMITS_DEG)


def _loop(
    label: str, of: TrackingRun | CalibrationOutcome, column: int, colour: str, time: Array
) -> Curve:
    return Curve(label, of.desired_deg[:, column], of.actual_deg[:, column], colour, time=time)


def calibration_figure(calibration: CalibrationOutcome) -> str:
    """Loop, and the tension of each wire, those of a joint together."""
    title = f"tip's angle (deg), loop {calibration.backlash_deg:.0f}° wide"
    loops = tuple(
        _loop(joint, calibration, column, f'curve-{column + 1}', calibration.tracked_at)
        for column, joint in enumerate(JOINTS)
    )
    plots = [_LOOP(title, curves=loops, height=240)]
    tensions = (0.0, 1.05 * float(calibration.tension.max()))
    wires = [
        Curve(name, calibration.time, tension, name.replace('_', '-'))
        for name, tension in zip(calibration.wires, calibration.tension.T, strict=True)
    ]
    for number, joint in enumerate(JOINTS):
        pair = tuple(wires[2 * number : 2 * number + 2])
        plots.append(_COURSE(f'{joint}, tension (N)', curves=pair, height=130, range_y=tensions))
    return figure_html(plots, _calibration_in_words(calibration.facts))


def endoscope_picture() -> str:
    """The drawing of an endoscope that stands at the top of the page, as SVG."""
    return (files('endoscope_bringup') / 'demo/templates/endoscope.svg').read_text()


def report_page(results: DemoResults, facts: dict[str, str]) -> str:
    """HTML of the whole report, in one file; `facts`, how it was made, stand at the foot."""
    rows = table_rows(results)
    order = ranking(rows)
    best, shown = order[0], MOTIONS[0]
    tubes = [
        {
            'calibration': calibration,
            'title': calibration.facts.tube.capitalize(),
            'calibration_figure': calibration_figure(calibration),
            'loops_figure': loops_figure(results, calibration.facts.tube, shown, best),
            'tracking': [
                tracking_figure(results, calibration.facts.tube, m, order) for m in MOTIONS
            ],
        }
        for calibration in results.calibrations
    ]
    recorded = [(topic, n, results.lost.get(topic, 0)) for topic, n in results.messages.items()]
    return render_page(
        'endoscope_bringup',
        'demo/templates/report.html.j2',
        filters={'degrees': _degrees},
        picture=endoscope_picture(),
        headline=headline(rows),
        figures={
            figure: {m: values_of(rows, figure, m) for m in Method} for figure in (RMSE, LARGEST)
        },
        shares={m: _shares(rows, m) for m in Method},
        method=Method,
        of_the_paper=_percent([ours.mean / none.mean for none, ours, *_ in TABLE_5.values()]),
        noise_deg=results.noise_deg,
        cut=where_signals_were_cut(results, best),
        order=order,
        best=best,
        meaning=MEANING,
        colour=COLOUR,
        rows=rows,
        tubes=tubes,
        facts=facts,
        recorded=html_table(('recorded topic', 'messages', 'lost'), recorded, words=1),
    )


def _shares(rows: Sequence[TableRow], method: Method) -> str:
    """What a method leaves of the uncompensated RMSE."""
    return _percent([row.left(method) for row in of_figure(rows, RMSE)])


def _degrees(values: float | Sequence[float]) -> str:
    """From the least to the greatest of some angles, or one."""
    return f'{_range(np.atleast_1d(values))}°'


def headline(rows: Sequence[TableRow]) -> str:
    """What was wrong and what became of it, in one sentence without its stop."""
    best = ranking(rows)[0]
    wrong = f'The tip lags: a loop {_degrees(values_of(rows, BACKLASH, Method.NONE))} wide opens'
    if best is Method.NONE:
        return f'{wrong}, and no compensation makes the error smaller'
    return f'{wrong}; {best} leaves {_shares(rows, best)} of the error'


def where_signals_were_cut(results: DemoResults, best: Method) -> list[str]:
    """Which signals go beyond the reach of a tube, and what is left of them uncut."""
    sentences = []
    for calibration in results.calibrations:
        facts = calibration.facts
        cuts, uncut = [], []
        for motion in MOTIONS:
            run = results.run(facts.tube, motion, best)
            cut = np.abs(_whole_signal(run) - run.desired_deg).max(axis=1)
            if cut.max() < LEAST_CUT_DEG:
                continue
            none = _whole_rmse(results.run(facts.tube, motion, Method.NONE))
            cuts.append(
                f'{MOTION_TITLE[motion]} by up to {_degrees(cut.max())}, '
                f'{100 * np.mean(cut >= LEAST_CUT_DEG):.0f} % of the time'
            )
            uncut.append(f'{_whole_rmse(run):.2f}° of {none:.2f}°')
        if cuts:
            sentences.append(
                f'The {facts.tube} can be bent {_reach(facts)} only, as its calibration found; '
                f'there the signals were cut for every method: {"; ".join(cuts)}. Against the '
                f'whole signals {best} leaves {" and ".join(uncut)} RMSE.'
            )
    return sentences


def _loops_in_words(results: DemoResults, tube: str, motion: str, best: Method) -> str:
    """What a tube's loops show."""
    text = f'{tube.capitalize()}, {MOTION_TITLE[motion]}. A perfect tip stays on the dotted line.'
    if best is Method.NONE:
        return text
    none, with_best = (results.run(tube, motion, m).backlash_deg for m in (Method.NONE, best))
    return f'{text} Uncompensated its loop is {none:.0f}° wide, by {best} {with_best:.1f}°.'


def _tracking_in_words(
    results: DemoResults, tube: str, motion: str, methods: Sequence[Method]
) -> str:
    """What the runs of one motion show."""
    runs = [results.run(tube, motion, method) for method in methods]
    figures = '; '.join(
        f'{run.method} RMSE {run.rmse_deg:.2f}°, largest {run.largest_deg:.1f}°' for run in runs
    )
    return (
        f'{MOTION_TITLE[motion]}: dashed what each joint was asked for in that run, in colour '
        f'where the tip was. The filled area is the error: {figures}.'
    )


def _calibration_in_words(facts: CalibrationFacts) -> str:
    """What a calibration shows."""
    return (
        f'{facts.tube.capitalize()}, calibration: the tensions of the four wires put the tube in '
        f'class {facts.class_deg:.0f}° with probability '
        f'{facts.probabilities[int(facts.class_deg)]:.2f} and gave its plant, '
        f"{facts.duration:.1f} s after the request. The loop is the tracker's, which neither sees."
    )


def _whole_signal(run: TrackingRun) -> Array:
    return np.degrees(motion_by_name(run.motion).sample(run.time)[0])


def _whole_rmse(run: TrackingRun) -> float:
    return mean_over_joints(tracking_rmse, _whole_signal(run), run.actual_deg)


def _reach(facts: CalibrationFacts) -> str:
    ranges = [f'from {low:.0f}° to {high:.0f}°' for low, high in facts.reach_deg]
    if len(set(ranges)) == 1:
        return ranges[0]
    return ', '.join(f'{joint} {way}' for joint, way in zip(JOINTS, ranges, strict=True))


def _percent(shares: Sequence[float]) -> str:
    return f'{_range([100 * share for share in shares])} %'


def _range(values: Sequence[float] | Array) -> str:
    low, high = (f'{x:.0f}' if x >= 9.95 else f'{x:.1f}' for x in (min(values), max(values)))
    return low if low == high else f'{low} to {high}'
