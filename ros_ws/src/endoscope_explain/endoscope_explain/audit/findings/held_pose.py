"""Poses that the motors were held at while no commands came.

A motor driver that hears nothing any more holds the shafts where they are at that moment, which is
short of the last command if they were on their way. What was commanded then is in no topic.
"""

import numpy as np

from endoscope_core.rig import Rig
from endoscope_core.safety import MotionLimits, MotionShaper
from endoscope_explain.audit.examined import Examined, find_gaps, usual_interval
from endoscope_explain.audit.finding import FindingKind, Severity
from endoscope_explain.recording import Array, Series

KIND = FindingKind(
    'held_pose',
    Severity.NOTE,
    '{signals} paused in mid-motion, and the motors held where they were ({count:.0f} times, first '
    'at {begin:.3f} s)',
    'the poses that were held are taken for commands',
)
_THERE_RAD = 1e-6


def find(seen: Examined) -> Examined:
    """Command the poses."""
    recording = seen.recording
    command, shaft, rig = recording.command, recording.shaft_position, recording.rig
    if shaft is None or len(command.time) < 2:
        return seen
    count = 2.0 * np.pi / seen.plant.sensors.encoder_counts
    poses = []
    for begin, end in find_gaps(command, float(command.time[0]), recording.duration):
        last = command.values[np.searchsorted(command.time, begin)]
        pose = _held_pose(shaft, begin, end, last, count, rig)
        if pose is not None:
            poses.append(pose)
    if not poses:
        return seen
    times, evidence = [(at, at) for at, _ in poses], {'count': float(len(poses))}
    found = KIND.found(recording, (command.topic,), times, evidence=evidence)
    beat = usual_interval(shaft.time)
    command = _with_goals(command, [_way(command, *pose, beat, rig) for pose in poses])
    return seen.found(found, recording=recording.with_series({'command': command}))


def _held_pose(
    shaft: Series, begin: float, end: float, last: Array, count: float, rig: Rig
) -> tuple[float, Array] | None:
    """When (s) the shafts were made to hold, and where; None if they went to the last command."""
    given_up = begin + rig.timeouts.command
    if end <= given_up:
        return None
    inside = (shaft.time >= begin) & (shaft.time < end) & shaft.valid.all(axis=1)
    time, angle = shaft.time[inside], shaft.values[inside]
    resting = angle[time >= 0.5 * (begin + end)]
    if len(resting) < 2 or np.ptp(resting, axis=0).max() > 1.5 * count:
        return None
    rest = np.median(resting, axis=0)
    if np.abs(rest - last).max() <= 1.5 * count:
        return None
    beat = usual_interval(shaft.time)
    # A pose is held if the shafts end at it although they were sent on, and if they came by it no
    # later than the driver gives a stream up: as a rule at that very moment.
    there = (np.abs(angle - rest) < 1.5 * count).all(axis=1) & (time <= given_up + 2.0 * beat)
    if not there.any():
        return None
    by = float(time[there][0])
    return (given_up if (there & (time >= given_up - 2.0 * beat)).any() else by), rest


def _way(command: Series, at: float, pose: Array, beat: float, rig: Rig) -> tuple[Array, Array]:
    """Goals on the way from the last command to a pose, at each beat of the driver."""
    motors = rig.motors
    last = command.values[np.searchsorted(command.time, at) - 1]
    reach = max(motors.reach, float(np.abs([last, pose]).max()))
    limits = (reach, motors.speed, motors.acceleration, motors.step)
    shaper = MotionShaper(MotionLimits.either_way(len(pose), *limits))
    shaper.restart(last.tolist())
    goals = [np.array(shaper.shape(pose.tolist(), beat))]
    while np.abs(goals[-1] - pose).max() > _THERE_RAD:
        goals.append(np.array(shaper.shape(pose.tolist(), beat)))
    goals[-1] = pose
    times = np.asarray(at + beat * np.arange(len(goals)), dtype=np.float64)
    return times, np.stack(goals)


def _with_goals(command: Series, ways: list[tuple[Array, Array]]) -> Series:
    """A command with the times (N,) in s and goals (N, J) of some ways in it."""
    at = np.concatenate([time for time, _ in ways])
    place = np.searchsorted(command.time, at, side='right')
    values = np.insert(command.values, place, np.concatenate([goals for _, goals in ways]), axis=0)
    received = command.received
    if received is not None:
        # Heard as long after their stamps as the commands before them.
        delay = received[place - 1] - command.time[place - 1]
        received = np.insert(received, place, at + delay)
    time = np.insert(command.time, place, at)
    return Series.of(command.topic, time, values, received)
