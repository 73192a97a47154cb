"""`endoscope bench validity`: how long a calibration stays valid while the rig changes in hours."""

import argparse
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from endoscope_core.atomic_output import write_text
from endoscope_core.classifier.cnn_classifier import load_classifier
from endoscope_core.control import FeedforwardLaw
from endoscope_core.errors import EndoscopeError
from endoscope_core.identification.law_choice import CalibrationFindings, LawChoice
from endoscope_core.monitoring import RigWatch
from endoscope_core.monitoring.rig_watch import BLOCK_S
from endoscope_core.physics import EffectSpec, PlantDescription, SensorModel, layout
from endoscope_core.physics.simulator import TICK
from endoscope_core.signals import non_periodic_signal
from endoscope_lab.bench import (
    chosen,
    keep_row,
    report,
    rows_so_far,
    side_by_side,
    table_head,
    table_row,
    today_and_machine,
)
from endoscope_lab.concealed import motions
from endoscope_lab.papers.tracking_trial import (
    NeverSeenTube,
    calibrate,
    never_seen_tube,
    run_tracking_trial,
    within_reach,
)
from endoscope_lab.still_pictures import STYLE, svg
from endoscope_lab.watch.changing_rig import MovingRig, motion_of, show

Array = NDArray[np.float64]

HOURS = (0.0, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0)
"""Hours of work after which a rig is calibrated again and moved."""
NONE, OLD_CLASS, NEW_CLASS, OLD_PLANT, NEW_PLANT = (
    'none', 'class then', 'class now', 'plant then', 'plant now',
)  # fmt: skip
SCHEMES = {
    NONE: ('none', '', False),
    OLD_CLASS: ('bouc_wen', 'class', False),
    NEW_CLASS: ('bouc_wen', 'class', True),
    OLD_PLANT: ('physical', 'plant', False),
    NEW_PLANT: ('physical', 'plant', True),
}
"""Mode, what selects it, and whether the latest calibration does."""
_BLOCK = round(BLOCK_S / TICK)
_BEFORE_S, _AFTER_S = 60.0, 15.0
_LOST_N, _RETENSIONED, _RUN_IN, _RUN_IN_H, _LOAD_NM = 1.6, 2.0, 0.3, 1.0, 8e-4
_BENT = ((1.0, 1.0), (2.0, 1.4), (3.0, 0.8), (math.inf, 1.6))


@dataclass(frozen=True)
class Slow:
    """Slow changes of a rig."""

    lost: float = 0.0  # pretension of every wire, N
    factor: float = 1.0  # of the sheaths' exponents
    moment: float = 0.0  # of a load on the tip, N m


def creeping(hour: float) -> Slow:
    """Wires relax with the logarithm of time, and are tightened again after two hours."""
    since = hour - _RETENSIONED if hour > _RETENSIONED else hour
    # In two hours, the typical loss of the catalogue.
    return Slow(lost=_LOST_N * math.log1p(60.0 * since) / math.log1p(60.0 * _RETENSIONED))


def running_in(hour: float) -> Slow:
    """Sheaths lose friction as their surfaces run in."""
    return Slow(factor=1.0 - _RUN_IN * -math.expm1(-hour / _RUN_IN_H))


def bent(hour: float) -> Slow:
    """The bend of the tube changes from time to time."""
    return Slow(factor=next(factor for until, factor in _BENT if hour < until))


def loaded(hour: float) -> Slow:
    """An instrument is inserted into the channel after an hour, and a heavier one after three."""
    return Slow(moment=_LOAD_NM * (0.0 if hour < 1.0 else 1.0 if hour < 3.0 else 2.0))


def all_of_it(hour: float) -> Slow:
    """All changes together."""
    return Slow(
        creeping(hour).lost, running_in(hour).factor * bent(hour).factor, loaded(hour).moment
    )


CAUSES: dict[str, Callable[[float], Slow]] = {
    'creep and re-tensioning': creeping,
    'run-in': running_in,
    'tube bent anew': bent,
    'load at the tip': loaded,
    'all together': all_of_it,
}


@dataclass(frozen=True)
class AgedRig:
    """One rig after some hours."""

    cause: str
    seed: int
    hour: float
    class_deg: int | None  # by a new calibration
    size_deg: float | None
    error_deg: tuple[float, ...]  # rms, by `SCHEMES`; NaN if the calibration lacks what a law needs
    detected: bool  # whether a watch that knows the initial rig reports the change


def run(args: argparse.Namespace) -> int:
    """Print a table, and draw it on request; return 0."""
    causes = tuple(chosen('cause', args.only, CAUSES))
    rows = {(row.cause, row.seed, row.hour): row for row in rows_so_far(args.json, AgedRig)}
    calls = [(c, s) for s in args.seeds for c in causes if (c, s, HOURS[-1]) not in rows]
    for done, (call, future) in enumerate(side_by_side(args.jobs, aged, calls), 1):
        for row in future.result():
            rows[row.cause, row.seed, row.hour] = row
            keep_row(args.json, row)
        report(f'{done} of {len(calls)}: {call[0]}, seed {call[1]}')
    wanted = [row for row in rows.values() if row.seed in args.seeds]
    print(today_and_machine())
    print(table(wanted, causes))
    if args.picture:
        write_text(args.picture, picture(wanted, causes))
    return 0


def aged(cause: str, seed: int) -> list[AgedRig]:
    """Calibrate, move and watch a rig in a tube that no fit has used, on one core."""
    with threadpool_limits(1):
        tube, classifier, choice = never_seen_tube(seed, 0), load_classifier(), LawChoice(2)
        first = calibrate(tube, classifier)
        rows: list[AgedRig] = []
        for hour in HOURS:
            slow = CAUSES[cause](hour)
            now = replace(tube, plant=plant_after(tube.plant, slow), noise=tube.noise + len(rows))
            found = calibrate(now, classifier) if hour else first
            errors = tuple(
                _error(now, choice, mode, by, found if fresh else first)
                for mode, by, fresh in SCHEMES.values()
            )
            size = None if found.size is None else math.degrees(found.size)
            detected = hour > 0.0 and is_detected(tube, slow, first, seed)
            rows.append(AgedRig(cause, seed, hour, found.class_deg, size, errors, detected))
        return rows


def plant_after(plant: PlantDescription, slow: Slow) -> PlantDescription:
    """The plant after slow changes."""
    joints = {
        name: replace(
            joint,
            pretension=joint.pretension - slow.lost,
            capstan_exponent=joint.capstan_exponent * slow.factor,
        )
        for name, joint in plant.joints.items()
    }
    load = {'moment_nm': slow.moment, 'time_s': 0.0}
    effects = [EffectSpec('external_load', name, load) for name in joints if slow.moment]
    return replace(plant, joints=joints, effects=(*plant.effects, *effects))


def _error(
    tube: NeverSeenTube, choice: LawChoice, mode: str, by: str, found: CalibrationFindings
) -> float:
    """Rms error in deg of another motion; NaN if the calibration lacks what the law needs."""
    try:
        law = choice.law(mode, by, found) if by else FeedforwardLaw()
    except EndoscopeError:
        return math.nan
    signal = within_reach(non_periodic_signal(), tube.plant)
    return math.degrees(run_tracking_trial(tube.plant, signal, law, False, tube.noise).rmse)


def is_detected(tube: NeverSeenTube, slow: Slow, first: CalibrationFindings, seed: int) -> bool:
    """Whether a watch reports the change of a rig that it has learnt, within 15 s of motion.

    It uses the plant that the first calibration identified. The slow change happens at once.
    """
    if not first.plants:
        return False
    names = tube.plant.joint_names()
    joints = {name: found.joint for name, found in zip(names, first.plants, strict=True)}
    watch = RigWatch(replace(tube.plant, joints=joints))
    changes = {'factor': slow.factor, 'time_s': _BEFORE_S}
    load = {'moment_nm': slow.moment, 'time_s': _BEFORE_S}
    effects = [EffectSpec('configuration_change', name, changes) for name in names]
    effects += [EffectSpec('external_load', name, load) for name in names]
    rig = MovingRig(replace(tube.plant, effects=tuple(effects)))
    sensors = SensorModel(tube.plant.sensors, seed)
    stiffness = np.array([joint.wire_stiffness for joint in tube.plant.joints.values()])
    generator = np.random.default_rng(seed)
    moving = motion_of(generator, _BEFORE_S + _AFTER_S, [motions.teleoperation])
    for begin in range(0, len(moving), _BLOCK):
        if begin == round(_BEFORE_S / TICK):
            travel = slice(layout.TRAVEL, layout.TRAVEL + 2)
            rig.state[0][:, travel] += (slow.lost / stiffness)[:, None]
        setpoint = moving[begin : begin + _BLOCK]
        show(watch, sensors, begin, setpoint, rig.move(setpoint))
    return any(alarm.at >= _BEFORE_S for alarm in watch.alarms)


def table(rows: Sequence[AgedRig], causes: Sequence[str]) -> str:
    """A line for each cause and hour, means over tubes."""
    columns = ('cause', 'h', 'tubes', 'same class', 'size, deg', *(f'{s}, deg' for s in SCHEMES))
    lines = [table_head(*columns, 'watch reports')]
    for cause in causes:
        first = {row.seed: row for row in rows if row.cause == cause and row.hour == 0.0}
        for hour in HOURS:
            of = _of(rows, cause, hour)
            if not of:
                continue
            same = sum(row.class_deg == first[row.seed].class_deg for row in of)
            sizes = [row.size_deg for row in of if row.size_deg is not None]
            means = [_mean(row.error_deg[k] for row in of) for k in range(len(SCHEMES))]
            errors = ['-' if math.isnan(mean) else f'{mean:.1f}' for mean in means]
            size = f'{np.mean(sizes):.0f}' if sizes else '-'
            detected = sum(row.detected for row in of)
            lines.append(table_row(cause, hour, len(of), same, size, *errors, detected))
    return '\n'.join(lines)


def picture(rows: Sequence[AgedRig], causes: Sequence[str]) -> str:
    """Errors over hours by each scheme, with the share of tubes in which a watch reports (SVG)."""
    with rc_context(STYLE):
        figure = Figure(figsize=(8.0, 2.3 * math.ceil(len(causes) / 2)), layout='constrained')
        grid = figure.subplots(math.ceil(len(causes) / 2), 2, sharex=True, squeeze=False)
        axes = list(grid.flat)
        for cause, plot in zip(causes, axes, strict=False):
            of_hour = partial(_of, rows, cause)
            for k, (name, (_, _, fresh)) in enumerate(SCHEMES.items()):
                errors = [_mean(row.error_deg[k] for row in of_hour(h)) for h in HOURS]
                line = '-' if fresh or name == NONE else '--'
                colour = 'C3' if 'class' in name else 'C0' if 'plant' in name else '0.5'
                plot.plot(HOURS, errors, line, color=colour, label=name)
            for hour in HOURS:
                share = np.mean([row.detected for row in of_hour(hour)])
                if share:
                    mark = plot.plot(hour, 0.0, '^', color='C1', alpha=share, clip_on=False)
                    mark[0].set_label('watch reports' if share == 1.0 else '')
            plot.set_title(cause)
            plot.set_ylim(bottom=0.0)
            plot.tick_params(labelbottom=True)
        for plot in axes[len(causes) :]:
            plot.axis('off')
        labelled = zip(*figure.axes[0].get_legend_handles_labels(), strict=True)
        by_label = {label: handle for handle, label in labelled}
        figure.legend(by_label.values(), by_label, loc='outside lower center', ncols=6)
        for plot in axes[: len(causes)][-2:]:
            plot.set_xlabel('hours of work')
        figure.supylabel('rms error of the tip (deg)')
        return svg(figure)


def _mean(values: Iterable[float]) -> float:
    """Mean of the numbers that are not NaN; NaN if there is none."""
    numbers = [value for value in values if not math.isnan(value)]
    return float(np.mean(numbers)) if numbers else math.nan


def _of(rows: Sequence[AgedRig], cause: str, hour: float) -> list[AgedRig]:
    return [row for row in rows if (row.cause, row.hour) == (cause, hour)]
