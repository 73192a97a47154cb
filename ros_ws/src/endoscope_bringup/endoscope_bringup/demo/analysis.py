"""Reads the demonstration's recordings back and takes the figures from them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import Recording, open_bag
from endoscope_bringup.demo.procedure import CalibrationFacts, RecordedRun
from endoscope_bringup.demo.results import CalibrationOutcome, DemoResults, TrackingRun
from endoscope_core.signals import (
    CALIBRATION_RECORD_DURATION,
    Signal,
    calibration_sinusoid,
    motion_by_name,
)
from endoscope_nodes import names

Array = NDArray[np.float64]

REST_S = 0.5
"""Before a run, in which nothing has moved for some time."""

LATEST_START_S = 3.0


def analyse(
    bags: dict[str, Path],
    segments: Sequence[RecordedRun],
    calibrations: Sequence[CalibrationFacts],
    lost: dict[str, int],
) -> DemoResults:
    """Figures of all runs, from the recordings alone; `lost` is what recorders missed, by topic."""
    recordings = {tube: open_bag(path) for tube, path in bags.items()}
    angles = {tube: Angles.of(recording) for tube, recording in recordings.items()}
    messages: dict[str, int] = {}
    for recording in recordings.values():
        for name, topic in recording.topics.items():
            messages[name] = messages.get(name, 0) + topic.message_count
    return DemoResults(
        tuple(
            _calibration(recordings[facts.tube], angles[facts.tube], facts)
            for facts in calibrations
        ),
        tuple(run_of(angles[s.tube], s) for s in segments),
        _noise(angles, segments),
        dict(sorted(messages.items())),
        lost,
    )


@dataclass(frozen=True)
class Angles:
    """What was asked of the joints of one tube and what the tracker saw, s and rad."""

    time: Array  # (N,)
    actual: Array  # (N, J)
    asked_time: Array  # (M,)
    asked: Array  # (M, J)

    @classmethod
    def of(cls, recording: Recording) -> 'Angles':
        """Those of a recording."""
        actual = recording.joint_state(names.SLAVE_MEASURED).select(names.JOINTS)
        asked = recording.joint_state(names.SLAVE_COMMAND).select(names.JOINTS)
        return cls(
            actual.seconds(0),
            actual.require('position'),
            asked.seconds(0),
            asked.require('position'),
        )

    def between(self, start: float, end: float) -> 'Angles':
        """Those of an interval, its start at 0 s."""
        tracked = (self.time >= start) & (self.time < end)
        asked = (self.asked_time >= start) & (self.asked_time < end)
        return Angles(
            self.time[tracked] - start,
            self.actual[tracked],
            self.asked_time[asked] - start,
            self.asked[asked],
        )

    @property
    def desired(self) -> Array:
        """What was asked for at the tracker's stamps, (N, J)."""
        columns = [np.interp(self.time, self.asked_time, asked) for asked in self.asked.T]
        return np.column_stack(columns)


def run_of(angles: Angles, segment: RecordedRun) -> TrackingRun:
    """The steady part of a run, beside what was asked for."""
    own = angles.between(segment.start, segment.end)
    signal = motion_by_name(segment.motion).joints[names.JOINTS[0]]
    began = start_of_motion(own.asked_time, own.asked[:, 0], signal)
    if own.asked_time[-1] < began + signal.steady[1]:
        raise ValueError(
            f'{segment.tube}, {segment.motion}, {segment.method}: it began {began:.1f} s late and '
            'was not tracked to its end'
        )
    time = own.time - began
    inside = (time >= signal.steady[0]) & (time <= signal.steady[1])
    return TrackingRun(
        segment.tube,
        segment.motion,
        segment.method,
        time=time[inside],
        desired_deg=np.degrees(own.desired[inside]),
        actual_deg=np.degrees(own.actual[inside]),
    )


def start_of_motion(time: Array, desired: Array, signal: Signal) -> float:
    """When, in s to a ms, a motion began in what was asked for: `desired` (N,), rad."""
    # The way to the motion from the measured pose comes first.
    late = np.flatnonzero(time >= LATEST_START_S)[::10]
    least, most = desired[late].min(), desired[late].max()

    def misfit(start: float) -> float:
        # What was asked for is the signal, cut where the bending range of the tube ends.
        asked = np.clip(signal(time[late] - start)[0], least, most)
        return float(np.sum((asked - desired[late]) ** 2))

    coarse = min(np.arange(0.0, LATEST_START_S, 0.02), key=misfit)
    return float(min(np.arange(coarse - 0.02, coarse + 0.02, 0.001), key=misfit))


def _noise(angles: dict[str, Angles], segments: Sequence[RecordedRun]) -> float:
    """Of the tracker in degrees, rms, from the rests before the runs."""
    rests = [angles[s.tube].between(s.start - REST_S, s.start).actual for s in segments]
    return float(np.degrees(np.sqrt(np.mean([np.var(rest, axis=0, ddof=1) for rest in rests]))))


def _calibration(
    recording: Recording, angles: Angles, facts: CalibrationFacts
) -> CalibrationOutcome:
    wires = recording.joint_state(names.WIRES_MEASURED)
    wire_time = wires.seconds(0) - facts.start
    recorded = (wire_time >= 0) & (wire_time < CALIBRATION_RECORD_DURATION)
    own = angles.between(facts.start, facts.start + CALIBRATION_RECORD_DURATION)
    signal = calibration_sinusoid()
    steady = own.time >= signal.steady[0]
    desired = np.degrees(signal(own.time[steady])[0])
    return CalibrationOutcome(
        facts,
        wire_time[recorded],
        wires.require('effort')[recorded],
        wires.names,
        own.time[steady],
        np.column_stack([desired] * len(names.JOINTS)),
        np.degrees(own.actual[steady]),
    )
