"""What the demonstration's figures say, in sentences that follow from the figures alone."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from endoscope_bringup.demo.procedure import (
    MOTION_TITLE,
    MOTIONS,
    TABLE_5,
    CalibrationFacts,
    Method,
)
from endoscope_bringup.demo.results import (
    BACKLASH,
    RMSE,
    DemoResults,
    TableRow,
    TrackingRun,
    mean_over_joints,
    of_figure,
    ranking,
    values_of,
)
from endoscope_core.metrics import tracking_rmse
from endoscope_core.signals import motion_by_name
from endoscope_nodes.names import JOINTS

Array = NDArray[np.float64]

LEAST_CUT_DEG = 0.1


def shares(rows: Sequence[TableRow], method: Method) -> str:
    """What a method leaves of the uncompensated RMSE."""
    return _percent([row.left(method) for row in of_figure(rows, RMSE)])


def degrees(values: float | Sequence[float]) -> str:
    """From the least to the greatest of some angles, or one."""
    return f'{_range(np.atleast_1d(values))}°'


def headline(rows: Sequence[TableRow]) -> str:
    """What was wrong and what became of it, in one sentence without its stop."""
    best = ranking(rows)[0]
    wrong = f'The tip lags: a loop {degrees(values_of(rows, BACKLASH, Method.NONE))} wide opens'
    if best is Method.NONE:
        return f'{wrong}, and no compensation makes the error smaller'
    return f'{wrong}; {best} leaves {shares(rows, best)} of the error'


def of_the_paper() -> str:
    """What the first paper's compensator leaves of the RMSE on its rig."""
    return _percent([proposed.mean / none.mean for none, proposed, *_ in TABLE_5.values()])


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
                f'{MOTION_TITLE[motion]} by up to {degrees(cut.max())}, '
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


def of_loops(results: DemoResults, tube: str, motion: str, best: Method) -> str:
    """What a tube's loops show."""
    text = f'{tube.capitalize()}, {MOTION_TITLE[motion]}. A perfect tip stays on the dotted line.'
    if best is Method.NONE:
        return text
    none, with_best = (results.run(tube, motion, m).backlash_deg for m in (Method.NONE, best))
    return f'{text} Uncompensated its loop is {none:.0f}° wide, by {best} {with_best:.1f}°.'


def of_tracking(results: DemoResults, tube: str, motion: str, methods: Sequence[Method]) -> str:
    """What the runs of one motion show."""
    runs = [results.run(tube, motion, method) for method in methods]
    figures = '; '.join(
        f'{run.method} RMSE {run.rmse_deg:.2f}°, largest {run.largest_deg:.1f}°' for run in runs
    )
    return (
        f'{MOTION_TITLE[motion]}: dashed what each joint was asked for in that run, in colour '
        f'where the tip was. The filled area is the error: {figures}.'
    )


def of_calibration(facts: CalibrationFacts) -> str:
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
