"""The audit of a recording: what is wrong with it, and a version that can be analysed."""

from dataclasses import replace

import numpy as np

from endoscope_core.physics.description import PlantDescription, SensorParameters
from endoscope_explain.audit import stamps, wrong_samples
from endoscope_explain.audit.earlier_motion import with_state_at_start
from endoscope_explain.audit.finding import AuditReport, Finding, Severity
from endoscope_explain.audit.misreading import as_findings, unlike_the_plant
from endoscope_explain.audit.plausibility import Comparison, as_meant
from endoscope_explain.audit.standing_still import (
    frozen_findings,
    moves,
    resting_motor_findings,
    with_held_poses,
    without_frozen,
)
from endoscope_explain.recording import (
    LEAST_DURATION_S,
    MOVES_RAD,
    WIRES,
    Recording,
    Series,
    signal_name,
)

SETTLING_S = 0.5
"""How long after a gap in the commands the rig's answer is not judged."""


def audit_recording(recording: Recording, plant: PlantDescription) -> AuditReport:
    """Find what is wrong with a recording, and correct it to what it must mean where it can be."""
    findings: list[Finding] = []
    recorded, recording = recording, _on_ordered_stamps(recording, findings)
    in_other_units = stamps.stamp_unit_findings(recording, plant.sensors)
    if not in_other_units:
        findings += stamps.jitter_findings(recorded, plant.sensors)
    recording = _on_one_clock(stamps.in_seconds(recording, in_other_units), findings)
    over_all = ((0.0, recording.duration),)
    findings += [replace(f, intervals=over_all) for f in in_other_units]
    recording = _without_commandless_times(recording, findings)
    recording, noisy = _as_meant(recording, plant, findings)
    findings += resting_motor_findings(recording)
    recording = with_held_poses(recording, plant.sensors, findings)
    recording = _audited_motor(recording, plant.sensors, findings)
    recording = replace(
        recording,
        tension=_audited_tension(recording, plant.sensors, findings, noisy),
        bending=_audited_bending(recording, plant, findings, noisy),
    )
    recording = with_state_at_start(recording, plant, findings)
    order = (Severity.MISTAKE, Severity.FAULT, Severity.NOTE)
    findings.sort(key=lambda f: order.index(f.severity))
    return AuditReport(recording, tuple(findings))


def _on_ordered_stamps(recording: Recording, findings: list[Finding]) -> Recording:
    joint = recording.joints[0]
    cleaned = {}
    seen = set()
    for name, series in {'command': recording.command, **recording.measured()}.items():
        cleaned[name], found = stamps.order_stamps(series, joint)
        # Position, velocity and effort of the motor come in the same messages.
        if series.topic not in seen:
            findings += found
        seen.add(series.topic)
    return recording.with_series(cleaned)


def _as_meant(
    recording: Recording, plant: PlantDescription, findings: list[Finding]
) -> tuple[Recording, bool]:
    """The recording as it must be meant, and whether its readings have noise."""
    if recording.duration < LEAST_DURATION_S:
        return recording, True
    plant = plant.of_joints(recording.joints)
    comparison = Comparison(recording, plant)
    noisy = comparison.is_noisy()
    frozen = frozen_findings(
        recording, comparison.grid, comparison.expected(), comparison.noise, noisy
    )
    findings += frozen
    if not moves(recording.command):
        return recording, noisy
    if frozen:
        topics = {signal.partition(':')[0] for f in frozen for signal in f.signals}
        still = [n for n, s in recording.measured().items() if s.topic in topics]
        comparison = Comparison(recording, plant, still)
    mistakes = comparison.judged()
    before, after = comparison.shares(), comparison.shares(mistakes)
    findings += as_findings(recording, mistakes, before, after)
    unlike = comparison.unlike(mistakes)
    if unlike:
        findings.append(unlike_the_plant(recording, unlike))
    return without_frozen(as_meant(recording, mistakes), frozen), noisy


def _on_one_clock(recording: Recording, findings: list[Finding]) -> Recording:
    every = {'command': recording.command, **recording.measured()}
    skews = stamps.clock_skew_from_receipt({s.topic: s for s in every.values()})
    for topic, skew in skews.items():
        findings.append(stamps.skew_finding(topic, recording.joints[0], skew, recording.duration))
    changed = {
        name: stamps.retimed(s, skews[s.topic].value)
        for name, s in every.items()
        if s.topic in skews
    }
    return recording.with_series(changed)


def _without_commandless_times(recording: Recording, findings: list[Finding]) -> Recording:
    every = {s.topic: s for s in (recording.command, *recording.measured().values())}
    start = min(float(s.time[0]) for s in every.values())
    end = max(float(s.time[-1]) for s in every.values())
    gaps = {topic: stamps.find_gaps(s, start, end) for topic, s in every.items()}
    intervals = {topic: stamps.usual_interval(s.time) for topic, s in every.items()}
    # A command is in force until the next one: a master that pauses, or whose clutch is released,
    # leaves nothing out. Only where the command has moved on meanwhile some of it is missing, and
    # not even there if the motors have rested: then it began again from another pose.
    lost = stamps.missing_in(recording.command, gaps[recording.command.topic])
    blind = [
        (a, b)
        for a, b in _unknown_command(recording.command, lost, end)
        if not _rests(recording.shaft_position, a + SETTLING_S, b)
    ]
    gaps[recording.command.topic] = tuple(blind)
    missing = {topic: stamps.missing_in(every[topic], found) for topic, found in gaps.items()}
    findings += stamps.gap_findings(missing, intervals, recording.joints[0])
    findings += stamps.silence_findings(gaps, missing, recording.joints[0])
    if not blind:
        return recording
    changed = {}
    for name, series in recording.measured().items():
        wrong = np.zeros(len(series.time), bool)
        for a, b in blind:
            wrong |= (series.time > a) & (series.time < b + SETTLING_S)
        shape = (-1,) + (1,) * (series.values.ndim - 1)
        changed[name] = series.without(np.broadcast_to(wrong.reshape(shape), series.valid.shape))
    return recording.with_series(changed)


def _unknown_command(
    command: Series, gaps: tuple[tuple[float, float], ...], end: float
) -> list[tuple[float, float]]:
    """Gaps across which the command changed by more than its usual step."""
    unknown = []
    usual = float(np.quantile(np.abs(np.diff(command.values, axis=0)), 0.99))
    for a, b in gaps:
        if a < command.time[0] or b >= end:
            continue
        before = command.values[np.searchsorted(command.time, a)]
        after = command.values[np.searchsorted(command.time, b)]
        if np.abs(after - before).max() > 2.0 * usual:
            unknown.append((a, b))
    return unknown


def _rests(shaft: Series | None, begin: float, end: float) -> bool:
    """Whether all motors are known to stand still from begin to end."""
    if shaft is None:
        return False
    inside = (shaft.time >= begin) & (shaft.time < end)
    return bool(inside.sum() > 2 and np.ptp(shaft.values[inside], axis=0).max() < MOVES_RAD)


def _audited_motor(
    recording: Recording, sensors: SensorParameters, findings: list[Finding]
) -> Recording:
    position = recording.shaft_position
    if position is None:
        return recording
    held_at = np.zeros(position.valid.shape, bool)
    for j, joint in enumerate(recording.joints):
        repeated = wrong_samples.held_before_jump(
            position.time, position.values[:, j], 2.0 * np.pi / sensors.encoder_counts
        )
        signal = signal_name('shaft_position', joint)
        findings += wrong_samples.held_findings(joint, signal, position.time, repeated)
        held_at[:, j] = repeated
    motor = {n: s for n, s in recording.measured().items() if s.topic == position.topic}
    # Position, velocity and effort of the motor come in the same messages.
    return recording.with_series({name: s.without(held_at) for name, s in motor.items()})


def _audited_tension(
    recording: Recording, sensors: SensorParameters, findings: list[Finding], noisy: bool
) -> Series | None:
    series = recording.tension
    if series is None:
        findings.append(_no_load_cells(recording))
        return None
    interval = stamps.usual_interval(series.time)
    wrong = np.zeros(series.valid.shape, bool)
    for j, joint in enumerate(recording.joints):
        for wire in range(2):
            signal = signal_name('tension', joint, wire)
            values, seen = series.values[:, j, wire], series.valid[:, j, wire]
            pile = wrong_samples.clipped(
                values, sensors.load_cell_noise, sensors.load_cell_resolution
            )
            at_limit = np.zeros(len(values), bool)
            if pile is not None and (seen & pile[0]).any():
                at_limit, limit = seen & pile[0], pile[1]
                findings.append(
                    wrong_samples.saturation_finding(
                        joint,
                        signal,
                        series.time,
                        at_limit,
                        limit,
                        sensors.load_cell_resolution,
                        wire,
                    )
                )
            repeated, _ = wrong_samples.held(
                values, sensors.load_cell_noise, sensors.load_cell_resolution, interval
            )
            # A reading without noise, as of a simulation, may well repeat itself.
            repeated &= seen & ~at_limit & noisy
            findings += wrong_samples.held_findings(joint, signal, series.time, repeated)
            wrong[:, j, wire] = at_limit | repeated
    return series.without(wrong)


def _no_load_cells(recording: Recording) -> Finding:
    torque = recording.shaft_effort is not None
    beside = 'the torque of the motor alone tells' if torque else 'nothing tells'
    return Finding(
        'no_load_cells',
        Severity.NOTE,
        recording.joints[0],
        'recording',
        (WIRES,),
        ((0.0, recording.duration),),
        f'{WIRES} was not recorded: {beside} what acts in the sheaths from what acts in the joint, '
        'and pretension from friction',
        'an effect of one of them may be named for one of the other, and no load cell is judged',
    )


def _audited_bending(
    recording: Recording, plant: PlantDescription, findings: list[Finding], noisy: bool
) -> Series:
    series = recording.bending
    interval = stamps.usual_interval(series.time)
    motor = recording.shaft_position or recording.command
    isolated = np.zeros(series.valid.shape, bool)
    wrong = np.zeros(series.valid.shape, bool)
    for j, joint in enumerate(recording.joints):
        signal = signal_name('bending', joint)
        values = series.values[:, j]
        repeated, _ = wrong_samples.held(values, plant.sensors.tracker_noise, 0.0, interval)
        repeated &= series.valid[:, j] & noisy
        findings += wrong_samples.held_findings(joint, signal, series.time, repeated)
        asked = motor.values[:, j] / recording.gear
        travel = wrong_samples.motor_travel(series.time, motor.time, asked, 3.0 * interval)
        spikes = wrong_samples.find_outliers(values, plant.sensors.tracker_noise, travel)
        wrong[:, j] = repeated
        isolated[:, j] = spikes
    if isolated.any():
        findings.append(wrong_samples.outlier_finding(recording.joints, series, isolated))
    # All angles come from one pose.
    return series.without(wrong | isolated.any(axis=1, keepdims=True))
