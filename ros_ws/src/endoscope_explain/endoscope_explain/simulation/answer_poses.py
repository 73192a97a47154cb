"""Tip poses of an answer, for a recording that has them beside the bending angles."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import MessageStream, PoseSeries
from endoscope_bags.cdr_encoding import encode_poses
from endoscope_bags.message_types import POSE_STAMPED
from endoscope_core.kinematics import tip_pose
from endoscope_core.physics.plant_file import JOINT_NAMES

Floats = NDArray[np.float64]


def answer_poses(
    recorded: PoseSeries,
    stamp_ns: NDArray[np.int64],
    bending: Floats,
    joints: Sequence[str],
) -> MessageStream:
    """Poses that a tracker which reads these angles would tell.

    `recorded`: poses of the recording: when they were told, in which frame, of how long a section.
    `stamp_ns` (N,): when the angles were read; a recorded pose of another time has no answer.
    `bending` (N, J): angles in rad.
    `joints`: their J names; a joint that is not among them is straight.
    Returns: without the poses at which the section would be bent by half a turn or more, which a
        tracker cannot tell from others.
    """
    angles = np.zeros((len(stamp_ns), len(JOINT_NAMES)))
    for column, joint in enumerate(joints):
        angles[:, JOINT_NAMES.index(joint)] = bending[:, column]
    read = dict(zip(stamp_ns.tolist(), angles, strict=True))
    told = [
        (n, read[stamp])
        for n, stamp in enumerate(recorded.stamp_ns.tolist())
        if stamp in read and np.hypot(*read[stamp]) < np.pi
    ]
    kept = np.array([n for n, _ in told], dtype=np.int64)
    length = section_length(recorded)
    poses = [tip_pose(angle, length) for _, angle in told]
    return MessageStream(
        recorded.topic,
        POSE_STAMPED,
        encode_poses(
            recorded.stamp_ns[kept],
            np.array([position for position, _ in poses]).reshape(-1, 3),
            np.array([orientation for _, orientation in poses]).reshape(-1, 4),
            frame_id=recorded.frame_id,
        ),
        recorded.log_ns[kept],
        recorded.publish_ns[kept],
    )


def section_length(recorded: PoseSeries) -> float:
    """Length in m of the bending section whose tip was recorded; 0 where no pose tells it.

    A circular arc of length L that turns by a has a chord of ``2 L sin(a / 2) / a``.
    """
    chord = np.linalg.norm(recorded.position, axis=1)
    half_turn = np.arccos(np.clip(np.abs(recorded.orientation[:, 3]), 0.0, 1.0))
    length = chord / np.sinc(half_turn / np.pi)
    finite = length[np.isfinite(length)]
    return float(np.median(finite)) if finite.size else 0.0
