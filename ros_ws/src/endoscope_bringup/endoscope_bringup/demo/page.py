"""The demonstration's report as one self-contained page, with its plots."""

from importlib.resources import files

from endoscope_bringup.demo import sentences
from endoscope_bringup.demo.procedure import MEANING, MOTIONS, Method
from endoscope_bringup.demo.results import (
    CalibrationOutcome,
    DemoResults,
    TrackingRun,
    ranking,
    table_rows,
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
_TIME = 'time (s)'
_ASKED = 'asked for (deg)'
_DASHES = (6.0, 4.0)


def loops_figure(results: DemoResults, tube: str, motion: str, best: Method) -> str:
    """Actual against desired angle of each joint, uncompensated and by one method."""
    runs = [results.run(tube, motion, method) for method in dict.fromkeys((Method.NONE, best))]
    plots = [
        Plot(
            f"{joint}, tip's angle (deg)",
            _ASKED,
            tuple(
                Curve(
                    str(run.method),
                    run.desired_deg[:, column],
                    run.actual_deg[:, column],
                    COLOUR[run.method],
                    time=run.time,
                )
                for run in runs
            ),
            columns=6,
            loop=True,
            square=True,
            range_x=LIMITS_DEG,
            range_y=LIMITS_DEG,
            diagonal=True,
        )
        for column, joint in enumerate(JOINTS)
    ]
    return figure_html(plots, sentences.of_loops(results, tube, motion, best))


def tracking_figure(results: DemoResults, tube: str, motion: str, methods: list[Method]) -> str:
    """Angle over time beside what was asked for, a row for each method, and below the errors."""
    runs = [results.run(tube, motion, method) for method in methods]
    plots = [_track(run, column, joint) for run in runs for column, joint in enumerate(JOINTS)]
    compensated = [run for run in runs if run.method is not Method.NONE]
    plots += [
        Plot(
            f'{joint}, errors of the compensated runs (deg)',
            _TIME,
            tuple(
                Curve(str(run.method), run.time, run.error_deg[:, column], COLOUR[run.method])
                for run in compensated
            ),
            columns=6,
            height=130,
        )
        for column, joint in enumerate(JOINTS)
    ]
    return figure_html(plots, sentences.of_tracking(results, tube, motion, methods))


def _track(run: TrackingRun, column: int, joint: str) -> Plot:
    asked = Curve(
        'asked for', run.time, run.desired_deg[:, column], 'wanted', dash=_DASHES, width=1.6
    )
    tip = Curve(
        str(run.method),
        run.time,
        run.actual_deg[:, column],
        COLOUR[run.method],
        to='asked for',
    )
    return Plot(f'{joint} (deg)', _TIME, (tip, asked), columns=6, height=110, range_y=LIMITS_DEG)


def calibration_figure(calibration: CalibrationOutcome) -> str:
    """Loop, and the tension of each wire, those of a joint together."""
    loops = tuple(
        Curve(
            joint,
            calibration.desired_deg[:, column],
            calibration.actual_deg[:, column],
            colour,
            time=calibration.tracked_at,
        )
        for column, (joint, colour) in enumerate(zip(JOINTS, ('curve-1', 'curve-2'), strict=True))
    )
    plots = [
        Plot(
            f"tip's angle (deg), loop {calibration.backlash_deg:.0f}° wide",
            _ASKED,
            loops,
            loop=True,
            height=240,
            diagonal=True,
        )
    ]
    highest = 1.05 * float(calibration.tension.max())
    for number, joint in enumerate(JOINTS):
        pair = range(2 * number, 2 * number + 2)
        plots.append(
            Plot(
                f'{joint}, tension (N)',
                _TIME,
                tuple(
                    Curve(
                        calibration.wires[k],
                        calibration.time,
                        calibration.tension[:, k],
                        f'wire-{"xy"[number]}-{("pos", "neg")[k % 2]}',
                    )
                    for k in pair
                ),
                height=130,
                range_y=(0.0, highest),
            )
        )
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
        picture=endoscope_picture(),
        headline=sentences.headline(rows),
        wrong=sentences.what_is_wrong(rows),
        helps=[(m, sentences.what_helps(rows, m)) for m in order if m is not Method.NONE],
        paper=sentences.beside_the_paper(rows, Method.BOUC_WEN),
        noise=sentences.beside_the_noise(results, best),
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
