"""Plots of real recordings and of the predictions of plants."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from endoscope_explain.report.numbers import PLANTS as LABEL
from endoscope_lab.real.alone import Withheld
from endoscope_lab.real.explained import ExplainedTubes
from endoscope_lab.real.rig import JudgedTake
from endoscope_lab.real.takes import TUBES
from endoscope_lab.still_pictures import INK, STYLE, svg, thinned

PLANTS = ('nominal', 'refitted', 'augmented')
LINE = {
    'measured': ('-', INK),
    'nominal': ('-', '#c2571a'),
    'refitted': ('--', '#2f6fb7'),
    'augmented': ('-.', '#1a8a66'),
}


def five_loops(tubes: ExplainedTubes) -> str:
    """The last loop of each tube as measured, and simulated without and with what was missing."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 2.9), layout='constrained')
        axes = figure.subplots(1, len(tubes.takes), sharey=True)
        for axis, judged in zip(axes, tubes.takes, strict=True):
            take, plants = judged.take, judged.plants
            channel = plants['refitted'].model.observation.channels[-1]
            seen = channel.time >= channel.time[-1] - take.cycle_s
            command = np.rad2deg(np.interp(channel.time, take.time, take.command))
            for label, values, colour, width in (
                ('measured', channel.value, '#b8c1cc', 4.0),
                ('simulated', plants['refitted'].predicted()[-1], LINE['nominal'][1], 1.2),
                (
                    'simulated, with what was missing',
                    plants['augmented'].predicted()[-1],
                    LINE['augmented'][1],
                    1.2,
                ),
            ):
                axis.plot(
                    command[seen], np.rad2deg(values[seen]), color=colour, lw=width, label=label
                )
            axis.set_title(f'tube bent by {take.name} deg')
            axis.set_xlabel('command (deg)')
        axes[0].set_ylabel('angle of the tip (deg)')
        handles = axes[0].get_legend_handles_labels()
        figure.legend(*handles, loc='outside lower center', ncols=3)
        return svg(figure)


def loops(judged: JudgedTake, last: str) -> str:
    """Angle and tensions over the command, measured and as each plant predicts them (SVG)."""
    take = judged.take
    channels = judged.plants['nominal'].model.observation.channels
    curves = {name: judged.plants[name].predicted() for name in PLANTS}
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 3.3), layout='constrained')
        axes = figure.subplots(1, len(channels), squeeze=False)[0]
        order = [len(channels) - 1, *range(len(channels) - 1)]
        for axis, k in zip(axes, order, strict=True):
            channel = channels[k]
            seen = channel.time >= judged.begin
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


def function_over_angle(withheld: Withheld) -> str:
    """The function that is found where the name is withheld, one curve for each tube (SVG)."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(5.5, 3.2), layout='constrained')
        axis = figure.subplots()
        for tube, (state, values) in zip(TUBES, withheld.curves, strict=False):
            axis.plot(np.rad2deg(state), 1.0 + values, label=f'tube bent by {tube} deg')
        axis.set_xlabel('angle of the joint (deg)')
        axis.set_ylabel("factor on the joint's friction")
        axis.legend(fontsize=8)
        return svg(figure)
