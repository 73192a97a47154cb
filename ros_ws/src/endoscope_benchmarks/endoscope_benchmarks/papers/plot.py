"""Loops and tracking of one tube that nothing was fitted on, before and after, as a figure."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from endoscope_benchmarks.trials.tracking_trial import (
    backlash_left,
    calibrate,
    never_seen_tube,
    run_tracking_trial,
)
from endoscope_core.classifier.weights_file import load_classifier
from endoscope_core.control import FeedforwardLaw
from endoscope_core.identification.law_choice import LawChoice
from endoscope_core.signals import periodic_signal
from endoscope_pages.still_pictures import INK, STYLE, svg, thinned

_SIZE_DEG = 94.0
_COLOURS = {
    'none': '#c2571a',
    'Bouc-Wen of the class': '#2f6fb7',
    'physical inverse': '#1a8a66',
}
_BEGIN = 3.0


def tracking_plot(seed: int) -> str:
    """An SVG element: three loops of 60 sin t, the motion and the errors around its reversals."""
    # The backlash is that of the paper's descending colon; rig, tube and noise are the seed's.
    tube = never_seen_tube(seed, 0, _SIZE_DEG)
    findings = calibrate(tube, load_classifier())
    choice, signal = LawChoice(2), periodic_signal()
    laws = {
        'none': FeedforwardLaw(),
        'Bouc-Wen of the class': choice.law('bouc_wen', 'class', findings),
        'physical inverse': choice.law('physical', 'plant', findings),
    }
    trials = {
        name: run_tracking_trial(tube.plant, signal, law, False, tube.noise)
        for name, law in laws.items()
    }
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 6.6), layout='constrained')
        halves = figure.add_gridspec(2, 1, height_ratios=(1.1, 1.0))
        loops = figure.add_subfigure(halves[0]).subplots(1, 3, sharex=True, sharey=True)
        above, below = figure.add_subfigure(halves[1]).subplots(2, 1, sharex=True)
        for axis, (name, trial) in zip(loops, trials.items(), strict=True):
            inside = trial.time >= signal.steady[0]
            desired = np.rad2deg(trial.desired[inside])
            bending = np.rad2deg(trial.bending[inside, 0])
            axis.plot([-95, 95], [-95, 95], color='#9aa5b1', linewidth=0.8, linestyle=':')
            axis.plot(*thinned(desired, bending), color=_COLOURS[name], linewidth=1.2)
            figures = (
                f'RMSE {np.rad2deg(trial.rmse):.1f}°\n'
                f'backlash {np.rad2deg(backlash_left(trial, signal)):.1f}°'
            )
            axis.text(0.03, 0.96, figures, transform=axis.transAxes, va='top', color=INK)
            axis.set_title(name)
            axis.set_aspect('equal')
            axis.set_xlim(-75, 75)
            axis.set_ylim(-75, 75)
            axis.set_xlabel('desired angle (deg)')
        loops[0].set_ylabel('actual angle (deg)')
        for name, trial in trials.items():
            shown = trial.time >= _BEGIN
            time = trial.time[shown]
            desired = np.rad2deg(trial.desired[shown])
            bending = np.rad2deg(trial.bending[shown, 0])
            if name == 'none':
                above.plot(*thinned(time, desired), color=INK, linestyle='--', label='desired')
            above.plot(*thinned(time, bending), color=_COLOURS[name], linewidth=1.0, label=name)
            below.plot(*thinned(time, bending - desired), color=_COLOURS[name], linewidth=1.0)
        above.set_ylabel('angle (deg)')
        above.set_ylim(-90.0, 120.0)
        above.legend(loc='upper right', ncols=4)
        below.set_ylabel('error (deg)')
        below.set_xlabel('time (s)')
        return svg(figure)
