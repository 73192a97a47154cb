"""The plots of the demonstration's report, each figure a string of HTML."""

from endoscope_bringup.demo.procedure import Method
from endoscope_bringup.demo.results import CalibrationOutcome, DemoResults, TrackingRun
from endoscope_core.pages.zoomable import Curve, Plot, figure_html
from endoscope_nodes.names import JOINTS

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


def loops_figure(results: DemoResults, tube: str, motion: str, best: Method, caption: str) -> str:
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
    return figure_html(plots, caption)


def tracking_figure(
    results: DemoResults, tube: str, motion: str, methods: list[Method], caption: str
) -> str:
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
    return figure_html(plots, caption)


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


def calibration_figure(calibration: CalibrationOutcome, caption: str) -> str:
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
    return figure_html(plots, caption)
