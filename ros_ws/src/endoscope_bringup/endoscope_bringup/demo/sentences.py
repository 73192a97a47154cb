"""What the demonstration's figures say, in sentences that follow from the figures alone."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from endoscope_bringup.demo.procedure import MOTION_TITLE, MOTIONS, CalibrationFacts, Method
from endoscope_bringup.demo.results import (
    BACKLASH,
    LARGEST,
    RMSE,
    DemoResults,
    TableRow,
    TrackingRun,
    of_figure,
    ranking,
)
from endoscope_core.metrics import tracking_rmse
from endoscope_core.signals import motion_by_name
from endoscope_nodes.names import JOINTS

Array = NDArray[np.float64]

LEAST_CUT_DEG = 0.1


def headline(rows: Sequence[TableRow]) -> str:
    """What was wrong and what became of it, in one sentence without its stop."""
    best = ranking(rows)[0]
    widths = [row.values[Method.NONE] for row in of_figure(rows, BACKLASH)]
    wrong = f'The tip lags: a loop {_degrees(widths)} wide opens'
    if best is Method.NONE:
        return f'{wrong}, and no compensation makes the error smaller'
    return f'{wrong}; {best} leaves {_shares(rows, best)} of the error'


def what_is_wrong(rows: Sequence[TableRow]) -> str:
    """How far an uncompensated tip is from where it shall be."""
    rmse = [row.values[Method.NONE] for row in of_figure(rows, RMSE)]
    largest = max(row.values[Method.NONE] for row in of_figure(rows, LARGEST))
    return (
        f'Uncompensated, the tip is {_degrees(rmse)} (RMSE) and up to {_degree(largest)} away from '
        'where it was asked to be.'
    )


def what_helps(rows: Sequence[TableRow], method: Method) -> str:
    """What a method leaves."""
    rmse = [row.values[method] for row in of_figure(rows, RMSE)]
    largest = max(row.values[method] for row in of_figure(rows, LARGEST))
    return (
        f'leaves {_shares(rows, method)} of the uncompensated RMSE: {_degrees(rmse)}, and at most '
        f'{_degree(largest)} at any instant.'
    )


def beside_the_paper(rows: Sequence[TableRow], method: Method) -> str:
    """What a method leaves beside what the first paper's compensator leaves on its rig."""
    papers = [
        row.paper_proposed.mean / row.paper_none.mean
        for row in of_figure(rows, RMSE)
        if row.paper_none is not None and row.paper_proposed is not None
    ]
    return (
        f"The first paper's compensator leaves {_percent(papers)} of the RMSE on its rig; its "
        f'method leaves {_shares(rows, method)} here.'
    )


def beside_the_noise(results: DemoResults, method: Method) -> str:
    """What a method leaves beside the noise of the tracker."""
    left = _degrees([run.rmse_deg for run in results.runs if run.method is method])
    return f"The tracker's noise alone is {results.noise_deg:.2f}° RMSE; {method} leaves {left}."


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
                f'{MOTION_TITLE[motion]} by up to {_degree(cut.max())}, '
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
    said = f'{tube.capitalize()}, {MOTION_TITLE[motion]}. A perfect tip stays on the dotted line.'
    if best is Method.NONE:
        return said
    none, with_best = (results.run(tube, motion, m).backlash_deg for m in (Method.NONE, best))
    return f'{said} Uncompensated its loop is {none:.0f}° wide, by {best} {with_best:.1f}°.'


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
    motion = motion_by_name(run.motion)
    return np.degrees(motion.sample(run.time)[0])


def _whole_rmse(run: TrackingRun) -> float:
    pairs = zip(_whole_signal(run).T, run.actual_deg.T, strict=True)
    return float(np.mean([tracking_rmse(*pair) for pair in pairs]))


def _reach(facts: CalibrationFacts) -> str:
    ranges = [f'from {low:.0f}° to {high:.0f}°' for low, high in facts.reach_deg]
    if len(set(ranges)) == 1:
        return ranges[0]
    return ', '.join(f'{joint} {way}' for joint, way in zip(JOINTS, ranges, strict=True))


def _shares(rows: Sequence[TableRow], method: Method) -> str:
    return _percent([row.left(method) for row in of_figure(rows, RMSE)])


def _percent(shares: Sequence[float]) -> str:
    return f'{_range([100 * share for share in shares])} %'


def _degrees(values: Sequence[float]) -> str:
    return f'{_range(values)}°'


def _degree(value: float) -> str:
    return _degrees([value])


def _range(values: Sequence[float]) -> str:
    low, high = (f'{x:.0f}' if x >= 9.95 else f'{x:.1f}' for x in (min(values), max(values)))
    return low if low == high else f'{low} to {high}'
