"""The plots of the demonstration's report, each a string of SVG."""

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from endoscope_bringup.demo.procedure import MOTIONS, Mode
from endoscope_bringup.demo.results import CalibrationOutcome, DemoResults
from endoscope_explain.report.figures.style import INK, STYLE, svg, thinned

MODE_COLOUR = {Mode.NONE: '#c2571a', Mode.FEED_FORWARD: '#2f6fb7', Mode.ADAPTIVE: '#1a8a66'}
WIRE_COLOUR = ('#2f6fb7', '#7fb0e0', '#c2571a', '#e8a877')
MOTION_TITLE = {'periodic': '60 sin t', 'non_periodic': '30 sin t + 30 sin √3 t'}


def loops_figure(results: DemoResults, tube: str) -> str:
    """Actual against desired angle in each mode, one panel for each motion and mode."""
    modes = tuple(Mode)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 6.0), layout='constrained')
        axes = figure.subplots(len(MOTIONS), len(modes), sharex=True, sharey=True)
        for row, motion in zip(axes, MOTIONS, strict=True):
            for axis, mode in zip(row, modes, strict=True):
                run = results.run(tube, motion, mode)
                axis.plot([-95, 95], [-95, 95], color='#9aa5b1', linewidth=0.8, linestyle=':')
                axis.plot(run.desired_deg, run.actual_deg, color=MODE_COLOUR[mode], linewidth=1.2)
                axis.set_title(f'{MOTION_TITLE[motion]} · {mode}')
                axis.text(
                    0.03,
                    0.96,
                    f'RMSE {run.rmse_deg:.1f}°\nbacklash {run.backlash_deg:.1f}°',
                    transform=axis.transAxes,
                    va='top',
                    color=INK,
                )
                axis.set_aspect('equal')
                axis.set_xlim(-95, 95)
                axis.set_ylim(-95, 95)
        for axis in axes[-1]:
            axis.set_xlabel('desired angle (deg)')
        for row in axes:
            row[0].set_ylabel('actual angle (deg)')
        return svg(figure)


def tracking_figure(results: DemoResults, tube: str, motion: str) -> str:
    """Desired and actual angle over time, and below it the error in each mode."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 4.4), layout='constrained')
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        runs = [results.run(tube, motion, mode) for mode in Mode]
        above.plot(
            *thinned(runs[0].time, runs[0].desired_deg),
            color=INK,
            linewidth=1.6,
            linestyle='--',
            label='desired',
        )
        for run in runs:
            colour = MODE_COLOUR[run.mode]
            above.plot(
                *thinned(run.time, run.actual_deg), color=colour, linewidth=1.2, label=str(run.mode)
            )
            below.plot(
                *thinned(run.time, run.actual_deg - run.desired_deg), color=colour, linewidth=1.0
            )
        above.set_title(MOTION_TITLE[motion])
        above.set_ylabel('bending angle (deg)')
        above.legend(ncols=4, loc='lower left', fontsize=8)
        below.set_ylabel('error (deg)')
        below.set_xlabel('time (s)')
        return svg(figure)


def calibration_figure(calibration: CalibrationOutcome) -> str:
    """Loop, four tensions and class probabilities of one calibration."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 2.9), layout='constrained')
        loop, tension, bars = figure.subplots(1, 3, width_ratios=(2, 4, 3))
        loop.plot(
            calibration.loop_desired_deg,
            calibration.loop_actual_deg,
            color=MODE_COLOUR[Mode.NONE],
            linewidth=1.2,
        )
        loop.set_title(f'loop, {calibration.backlash_deg:.0f}° wide')
        loop.set_xlabel('desired (deg)')
        loop.set_ylabel('actual (deg)')
        for column, (wire, colour) in enumerate(zip(calibration.wires, WIRE_COLOUR, strict=False)):
            tension.plot(
                *thinned(calibration.time, calibration.tension[:, column]),
                color=colour,
                linewidth=1.0,
                label=wire,
            )
        tension.set_title('wire tension')
        tension.set_xlabel('time (s)')
        tension.set_ylabel('tension (N)')
        tension.legend(ncols=2, fontsize=7)
        _probability_bars(bars, calibration)
        return svg(figure)


def _probability_bars(axis: Axes, calibration: CalibrationOutcome) -> None:
    classes = sorted(calibration.probabilities)
    values = [calibration.probabilities[c] for c in classes]
    chosen = [
        MODE_COLOUR[Mode.FEED_FORWARD] if c == calibration.class_deg else '#c3ccd5' for c in classes
    ]
    bars = axis.bar([f'{c}°' for c in classes], values, color=chosen)
    axis.bar_label(bars, labels=[f'{v:.2f}' if v >= 0.005 else '' for v in values], fontsize=7)
    axis.set_ylim(0, 1.1)
    axis.set_title(f'class {calibration.class_deg:.0f}°')
    axis.set_ylabel('probability')
    axis.grid(visible=False, axis='x')
