"""What the driver made of commands when a session ends, told from what a bag holds."""

import numpy as np
import pytest

from endoscope_bags import open_bag
from endoscope_bags.bag_writer import BagWriter, MessageStream
from endoscope_bags.cdr_encoding import encode_joint_states, encode_string, serialise
from endoscope_bags.message_types import JOINT_STATE, STRING, typestore
from endoscope_core.rig import shipped_rig
from endoscope_explain.recording.in_force import SESSION, STATE, goals_in_force
from endoscope_explain.recording.series import COMMAND, MOTOR

HEADER = 'std_msgs/msg/Header'
NAMES = ('motor_x', 'motor_y')
MS = 1_000_000
SPEED = 1e-3
"""Of the commands, rad a millisecond."""
LAG = 20
"""Milliseconds by which the motors are behind."""


def header(frame_id):
    types = typestore().types
    stamp = types['builtin_interfaces/msg/Time'](sec=0, nanosec=0)
    return serialise(HEADER, types[HEADER](stamp=stamp, frame_id=frame_id))


def replayed(path, stamps, logs, commands, sessions):
    """Goals in force, where motors follow commands that are their stamps in ms times `SPEED`.

    Parameters
    ----------
    stamps, logs : array (N,) of int
        Of the motors' readings, in ns.
    commands : array (M,) of int
        When they were stamped and received, in ns.
    sessions : list of (int, str)
    """
    path.mkdir()

    def joints(topic, stamp_ns, log_ns, position):
        both = np.stack([position, position], axis=1)
        payloads = encode_joint_states(NAMES, stamp_ns, position=both)
        return MessageStream(topic, JOINT_STATE, payloads, log_ns, log_ns)

    def texts(topic, kind, pairs, encode):
        at = np.array([t for t, _ in pairs])
        return MessageStream(topic, kind, [encode(text) for _, text in pairs], at, at)

    with BagWriter(path / 'bag') as writer:
        writer.write_streams(
            [
                joints(f'/{MOTOR}', stamps, logs, SPEED * (stamps / MS - LAG)),
                joints(f'/{COMMAND}', commands, commands, SPEED * commands / MS),
                texts(f'/{SESSION}', HEADER, sessions, header),
                texts(f'/{STATE}', STRING, [(stamps[0], 'ENABLED')], encode_string),
            ]
        )
    bag = open_bag(path / 'bag')
    command, motor = bag.joint_state(COMMAND), bag.joint_state(MOTOR)
    goals, _, told = goals_in_force(bag, command, motor, None, shipped_rig())
    assert 'held the measured pose once' in told
    return goals


def test_a_command_of_the_instant_in_which_its_session_ends_is_not_obeyed(tmp_path):
    at = MS * np.arange(10, 400)
    ended = 200 * MS
    sessions = [(10 * MS, 'session-1'), (ended, '')]
    goals = replayed(tmp_path / 'own', at, at, at[at <= ended], sessions)
    # The pose of then is held, and the goal brakes from the command of the instant before.
    assert goals.position[-1] == pytest.approx([SPEED * (200 - LAG)] * 2)
    braking = 1.0 / (2.0 * shipped_rig().motors.acceleration)
    assert goals.position.max() < SPEED * 199 + braking


def test_what_came_once_a_turn_was_due_is_heard_after_it(tmp_path):
    """The beat of 201 ms is served with that of 205: the session's end came in between."""
    stamps = MS * np.array([*range(10, 201), *range(205, 400)])
    logs = stamps + MS // 2
    ended = 203 * MS
    sessions = [(10 * MS, 'session-1'), (ended, '')]
    goals = replayed(tmp_path / 'late', stamps, logs, stamps[stamps <= ended], sessions)
    assert goals.position[-1] == pytest.approx([SPEED * (205 - LAG)] * 2)
