"""The commands that a recording holds, as motor shaft angles of a plant's joints."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import Recording
from endoscope_core.errors import EndoscopeError
from endoscope_core.physics import PlantDescription
from endoscope_core.rig import Rig
from endoscope_explain.recording.series import COMMAND, DESIRED
from endoscope_explain.recording.shaft_input import input_topic
from endoscope_explain.recording.signals import motor_name
from endoscope_explain.recording.usable_stamps import require_running_stamps


class NoCommandsError(EndoscopeError, ValueError):
    """A recording without commands for any joint of the plant."""


@dataclass(frozen=True)
class BagCommands:
    """Commands of some joints of a plant.

    `topic`: full name of the topic they come from.
    `joints`: joints of the plant that are commanded, in the plant's order.
    `stamp_ns` (N,): not decreasing.
    `shaft` (N, J): motor shaft angle in rad.
    """

    topic: str
    joints: tuple[str, ...]
    stamp_ns: NDArray[np.int64]
    shaft: NDArray[np.float64]


def commands_of_bag(recording: Recording, plant: PlantDescription, rig: Rig) -> BagCommands:
    """Shaft commands of a recording; desired angles times the rig's gear where it has none.

    Raises NoCommandsError: if neither topic is there, or no joint of the plant is commanded.
    Raises BagError: if a command is not finite or does not decode, or all are stamped alike.
    """
    topic = input_topic(recording)
    if not topic:
        raise NoCommandsError(recording.lacking(COMMAND, DESIRED))
    series = recording.joint_state(topic, finite=('position',))
    desired = topic == DESIRED
    names = {joint: joint if desired else motor_name(joint) for joint in plant.joints}
    require_running_stamps(recording.path, series)
    joints = tuple(joint for joint, name in names.items() if name in series.names)
    if not joints:
        raise NoCommandsError(
            f'{recording.path}: {series.topic} commands {", ".join(series.names) or "nothing"}, '
            f'the plant has {", ".join(names.values())}'
        )
    chosen = series.select([names[joint] for joint in joints])
    scale = rig.joints.gear if desired else 1.0
    return BagCommands(series.topic, joints, chosen.stamp_ns, scale * chosen.require('position'))
