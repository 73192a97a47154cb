"""The plots of the demonstration's report, each a string of SVG as wide as a phone's page."""

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from endoscope_bringup.demo.procedure import Method
from endoscope_bringup.demo.results import CalibrationOutcome, DemoResults
from endoscope_explain.report.figures.style import INK, STYLE, svg, thinned
from endoscope_nodes.names import JOINTS

COLOUR = {
    Method.NONE: '#c2571a',
    Method.BOUC_WEN: '#8a6fb0',
    Method.INVERSE: '#2f6fb7',
}
WIRE_COLOUR = '#2f6fb7'
PLAIN = '#9aa5b1'
WIDTH_IN = 5.2
LOOP_LIMIT_DEG = 70.0

_STYLE = STYLE | {'font.size': 8.0, 'axes.titlesize': 8.5}


def loops_figure(results: DemoResults, tube: str, motion: str, best: Method) -> str:
    """Actual against desired angle of each joint, uncompensated and by one method."""
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(WIDTH_IN, 2.9), layout='constrained')
        axes = figure.subplots(1, len(JOINTS), sharex=True, sharey=True)
        for column, (axis, joint) in enumerate(zip(axes, JOINTS, strict=True)):
            axis.axline((0.0, 0.0), slope=1.0, color=PLAIN, linewidth=0.8, linestyle=':')
            for method in dict.fromkeys((Method.NONE, best)):
                run = results.run(tube, motion, method)
                axis.plot(
                    run.desired_deg[:, column],
                    run.actual_deg[:, column],
                    color=COLOUR[method],
                    linewidth=1.2,
                    label=f'{method}: {run.backlash_deg:.1f}° wide',
                )
            axis.set_title(joint)
            axis.set_aspect('equal')
            axis.set_xlim(-LOOP_LIMIT_DEG, LOOP_LIMIT_DEG)
            axis.set_ylim(-LOOP_LIMIT_DEG, LOOP_LIMIT_DEG)
            axis.set_xlabel('asked for (deg)')
        axes[0].set_ylabel("tip's angle (deg)")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc='outside lower center', ncols=1, fontsize=8)
        return svg(figure)


def tracking_figure(results: DemoResults, tube: str, motion: str, methods: list[Method]) -> str:
    """Angle over time beside what was asked for in the same run, a row for each method.

    Below, the errors of all methods but `Method.NONE`.
    """
    runs = [results.run(tube, motion, method) for method in methods]
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(WIDTH_IN, 1.15 * (len(runs) + 1) + 0.3), layout='constrained')
        axes = figure.subplots(len(runs) + 1, len(JOINTS), sharex=True, sharey='row')
        for row, run in zip(axes, runs, strict=False):
            for column, axis in enumerate(row):
                _track(
                    axis,
                    run.time,
                    run.desired_deg[:, column],
                    run.actual_deg[:, column],
                    run.method,
                )
            row[0].set_title(
                f'{run.method}: RMSE {run.rmse_deg:.2f}°, largest {run.largest_deg:.1f}°'
            )
            row[0].set_ylabel('angle (deg)')
        for run in runs:
            if run.method is Method.NONE:
                continue
            for column, axis in enumerate(axes[-1]):
                axis.plot(
                    *thinned(run.time, run.error_deg[:, column]),
                    color=COLOUR[run.method],
                    linewidth=0.9,
                )
        axes[-1][0].set_title('errors of the compensated runs')
        axes[-1][0].set_ylabel('error (deg)')
        for axis, joint in zip(axes[-1], JOINTS, strict=True):
            axis.set_xlabel(f'time (s), {joint}')
        return svg(figure)


def _track(
    axis: Axes, time: np.ndarray, desired: np.ndarray, actual: np.ndarray, method: Method
) -> None:
    time, desired, actual = thinned(time, desired, actual)
    axis.fill_between(time, desired, actual, color=COLOUR[method], alpha=0.25, linewidth=0)
    axis.plot(time, actual, color=COLOUR[method], linewidth=1.1)
    axis.plot(time, desired, color=INK, linewidth=0.9, linestyle=(0, (4, 2)))
    axis.set_ylim(-LOOP_LIMIT_DEG, LOOP_LIMIT_DEG)
    axis.set_yticks([-60, 0, 60])


def calibration_figure(calibration: CalibrationOutcome) -> str:
    """Loop, class probabilities, and the tension of each wire."""
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(WIDTH_IN, 4.6), layout='constrained')
        wires = calibration.wires
        mosaic: Any = [['loop', 'class'], list(wires[:2]), list(wires[2:])]
        axes = figure.subplot_mosaic(mosaic, height_ratios=(3, 2, 2))
        loop = axes['loop']
        for joint, style, column in zip(JOINTS, ('-', '--'), range(len(JOINTS)), strict=True):
            loop.plot(
                calibration.desired_deg[:, column],
                calibration.actual_deg[:, column],
                style,
                color=COLOUR[Method.NONE],
                linewidth=1.0,
                label=joint,
            )
        loop.set_title(f'loop, {calibration.backlash_deg:.0f}° wide')
        loop.set_xlabel('asked for (deg)')
        loop.set_ylabel("tip's angle (deg)")
        loop.legend(loc='upper left', fontsize=7)
        _probability_bars(axes['class'], calibration)
        highest = 1.05 * float(calibration.tension.max())
        for column, wire in enumerate(wires):
            axis = axes[wire]
            axis.plot(
                *thinned(calibration.time, calibration.tension[:, column]),
                color=WIRE_COLOUR,
                linewidth=1.0,
            )
            axis.set_ylim(0.0, highest)
            axis.set_title(wire)
            axis.label_outer()
            if column % 2 == 0:
                axis.set_ylabel('tension (N)')
            if column >= len(wires) - 2:
                axis.set_xlabel('time (s)')
        return svg(figure)


def _probability_bars(axis: Axes, calibration: CalibrationOutcome) -> None:
    facts = calibration.facts
    classes = sorted(facts.probabilities)
    values = [facts.probabilities[c] for c in classes]
    chosen = [COLOUR[Method.BOUC_WEN] if c == facts.class_deg else '#c3ccd5' for c in classes]
    bars = axis.bar([f'{c}' for c in classes], values, color=chosen)
    axis.bar_label(bars, labels=[f'{v:.2f}' if v >= 0.005 else '' for v in values], fontsize=7)
    axis.set_ylim(0, 1.12)
    axis.set_title(f'class {facts.class_deg:.0f}°')
    axis.set_xlabel('class (deg)')
    axis.set_ylabel('probability')
    axis.grid(visible=False, axis='x')
