"""Reads the demonstration's recordings back and takes the figures from them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import Recording, open_bag
from endoscope_bringup.demo.procedure import CalibrationFacts, Segment
from endoscope_bringup.demo.results import CalibrationOutcome, DemoResults, TrackingRun
from endoscope_core.metrics import tracking_rmse, width_at_mid_height
from endoscope_core.signals import (
    CALIBRATION_RECORD_DURATION,
    calibration_sinusoid,
    motion_by_name,
)

Array = NDArray[np.float64]

SHOWN_JOINT = 'bend_x'
JOINTS = ('bend_x', 'bend_y')


def analyse(
    bags: dict[str, Path],
    segments: Sequence[Segment],
    calibrations: Sequence[CalibrationFacts],
    lost: dict[str, int],
) -> DemoResults:
    """Figures of all runs, from the recordings alone.

    Parameters
    ----------
    bags : dict of str to Path
        Recording of each tube.
    segments : sequence of Segment
    calibrations : sequence of CalibrationFacts
    lost : dict of str to int
        Messages that the recorder missed, by topic.

    Returns
    -------
    DemoResults

    Raises
    ------
    BagError
        If a recording lacks what is needed.
    ValueError
        If a run shows no loop.
    """
    recordings = {tube: open_bag(path) for tube, path in bags.items()}
    messages: dict[str, int] = {}
    for recording in recordings.values():
        for name, topic in recording.topics.items():
            messages[name] = messages.get(name, 0) + topic.message_count
    return DemoResults(
        tuple(_calibration(recordings[facts.tube], facts) for facts in calibrations),
        tuple(_run(recordings[segment.tube], segment) for segment in segments),
        dict(sorted(messages.items())),
        lost,
    )


def _run(recording: Recording, segment: Segment) -> TrackingRun:
    time, actual = _tracked(recording, segment.start, segment.end)
    desired = _desired(recording, time + segment.start)
    steady = motion_by_name(segment.motion).steady
    inside = (time >= steady[0]) & (time <= steady[1])
    errors, sizes = [], []
    for joint in range(len(JOINTS)):
        pair = np.degrees(desired[inside, joint]), np.degrees(actual[inside, joint])
        errors.append(tracking_rmse(*pair))
        sizes.append(abs(width_at_mid_height(*pair)))
    shown = JOINTS.index(SHOWN_JOINT)
    return TrackingRun(
        segment.tube,
        segment.motion,
        segment.mode,
        time,
        np.degrees(desired[:, shown]),
        np.degrees(actual[:, shown]),
        float(np.mean(errors)),
        float(np.mean(sizes)),
    )


def _calibration(recording: Recording, facts: CalibrationFacts) -> CalibrationOutcome:
    wires = recording.joint_state('wires/measured_js')
    wire_time = wires.seconds(0) - facts.start
    recorded = (wire_time >= 0) & (wire_time < CALIBRATION_RECORD_DURATION)
    time, actual = _tracked(recording, facts.start, facts.start + CALIBRATION_RECORD_DURATION)
    signal = calibration_sinusoid()
    shown = time >= signal.steady[0]
    desired = np.degrees(signal(time[shown])[0])
    loop = np.degrees(actual[shown, JOINTS.index(SHOWN_JOINT)])
    return CalibrationOutcome(
        facts.tube,
        wire_time[recorded],
        wires.require('effort')[recorded],
        wires.names,
        desired,
        loop,
        width_at_mid_height(desired, loop),
        facts.class_deg,
        facts.probabilities,
        facts.duration,
    )


def _tracked(recording: Recording, start: float, end: float) -> tuple[Array, Array]:
    series = recording.joint_state('slave/measured_js').select(JOINTS)
    time = series.seconds(0)
    inside = (time >= start) & (time < end)
    return time[inside] - start, series.require('position')[inside]


def _desired(recording: Recording, times: Array) -> Array:
    series = recording.joint_state('slave/servo_jp').select(JOINTS)
    stamps, position = series.seconds(0), series.require('position')
    return np.column_stack(
        [np.interp(times, stamps, position[:, joint]) for joint in range(len(JOINTS))]
    )
