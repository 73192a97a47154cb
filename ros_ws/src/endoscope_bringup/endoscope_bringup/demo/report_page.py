"""The demonstration's report as one self-contained page, with its plots."""

from functools import partial
from importlib.resources import files

from endoscope_bringup.demo import sentences
from endoscope_bringup.demo.procedure import MEANING, MOTIONS, Method
from endoscope_bringup.demo.results import (
    LARGEST,
    RMSE,
    Array,
    CalibrationOutcome,
    DemoResults,
    TrackingRun,
    ranking,
    table_rows,
    values_of,
)
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


def loops_figure(results: DemoResults, tube: str, motion: str, best: Method) -> str:
    """Actual against desired angle of each joint, uncompensated and by one method."""
    runs = [results.run(tube, motion, method) for method in dict.fromkeys((Method.NONE, best))]
    plots = []
    for column, joint in enumerate(JOINTS):
        curves = [_loop(str(r.method), r, column, COLOUR[r.method], r.time) for r in runs]
        plots.append(_SQUARE(f"{joint}, tip's angle (deg)", curves=tuple(curves)))
    return figure_html(plots, sentences.of_loops(results, tube, motion, best))


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
    return figure_html(plots, sentences.of_tracking(results, tube, motion, methods))


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
    return figure_html(plots, sentences.of_calibration(calibration.facts))


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
        filters={'degrees': sentences.degrees},
        picture=endoscope_picture(),
        headline=sentences.headline(rows),
        figures={
            figure: {m: values_of(rows, figure, m) for m in Method} for figure in (RMSE, LARGEST)
        },
        shares={m: sentences.shares(rows, m) for m in Method},
        method=Method,
        of_the_paper=sentences.of_the_paper(),
        noise_deg=results.noise_deg,
        cut=sentences.where_signals_were_cut(results, best),
        order=order,
        best=best,
        meaning=MEANING,
        colour=COLOUR,
        rows=rows,
        tubes=tubes,
        facts=facts,
        recorded=html_table(('recorded topic', 'messages', 'lost'), recorded, words=1),
    )
