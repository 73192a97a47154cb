"""Writes the bag in which a plant answers the commands of another bag.

Where that bag has tip poses beside bending angles, the answer has them too.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import BagWriter, JointStateSeries, MessageStream, PoseSeries, Recording
from endoscope_bags.cdr import encode_joint_states, encode_poses, encode_string
from endoscope_bags.message_types import JOINT_STATE, POSE_STAMPED, STRING
from endoscope_bags.recording import RIG_KIND, rig_of_bag, rig_record
from endoscope_bags.topic import LATCHED_QOS
from endoscope_core.errors import InputError
from endoscope_core.kinematics import tip_pose
from endoscope_core.names import JOINTS
from endoscope_core.physics import PlantDescription, SensorModel
from endoscope_core.physics.on_stamps import NANOSECONDS, AnswerStamps, RigReadings, answer_commands
from endoscope_core.physics.packing import recording_faults
from endoscope_core.physics.plant_file import plant_as_text
from endoscope_core.physics.sensing import TOPICS
from endoscope_core.physics.simulator import TICK
from endoscope_core.rig import Kind, Rig, RigKind, digest, rig_as_text
from endoscope_explain.recording import (
    BENDING,
    COMMAND,
    DESIRED,
    INPUT_TOPICS,
    MOTOR,
    WIRES,
    Array,
    input_topic,
    motor_name,
    require_running_stamps,
    wire_names,
)

POSE_TOPIC = 'tracker/measured_cp'

ROUNDING = 1.0 + 1e-9

READ_DELAYS = (0.0, TICK)
"""Seconds from a stamp to its reading that a rig at 1 kHz may have."""

Stamps = NDArray[np.int64]


def answer_poses(
    recorded: PoseSeries,
    stamp_ns: Stamps,
    bending: Array,
    joints: Sequence[str],
) -> MessageStream:
    """Poses that a tracker which reads these angles (N, J) in rad at these stamps would report."""
    # A pose at another time has no answer, nor has one at which the section would be bent by half a
    # turn or more: a tracker cannot distinguish it from others.
    angles = np.zeros((len(stamp_ns), len(JOINTS)))
    for column, joint in enumerate(joints):
        angles[:, JOINTS.index(joint)] = bending[:, column]
    read = dict(zip(stamp_ns.tolist(), angles, strict=True))
    seen = [
        (n, read[stamp])
        for n, stamp in enumerate(recorded.stamp_ns.tolist())
        if stamp in read and np.hypot(*read[stamp]) < np.pi
    ]
    kept = np.array([n for n, _ in seen], dtype=np.int64)
    length = section_length(recorded)
    poses = [tip_pose(angle, length) for _, angle in seen]
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
    """Length in m of the bending section whose tip was recorded; 0 where no pose shows it."""
    # A circular arc of length L that turns by a has a chord of ``2 L sin(a / 2) / a``.
    chord = np.linalg.norm(recorded.position, axis=1)
    half_turn = np.arccos(np.clip(np.abs(recorded.orientation[:, 3]), 0.0, 1.0))
    length = chord / np.sinc(half_turn / np.pi)
    finite = length[np.isfinite(length)]
    return float(np.median(finite)) if finite.size else 0.0


@dataclass(frozen=True)
class BagCommands:
    """Commands of some joints of a plant."""

    topic: str  # full name of the topic they come from
    joints: tuple[str, ...]  # joints of the plant that are commanded, in the plant's order
    stamp_ns: Stamps  # (N,), not decreasing
    shaft: Array  # (N, J), motor shaft angle in rad

    @property
    def namespace(self) -> str:
        """Namespace of the topic, with the slash at its end."""
        return reduce(str.removesuffix, INPUT_TOPICS, self.topic)


def commands_of_bag(recording: Recording, plant: PlantDescription, rig: Rig) -> BagCommands:
    """Shaft commands of a bag, or desired angles times the gear; InputError if none can be used."""
    topic = input_topic(recording)
    if not topic:
        raise InputError(recording.lacking(COMMAND, DESIRED))
    series = recording.joint_state(topic, finite=('position',))
    desired = topic == DESIRED
    names = {joint: joint if desired else motor_name(joint) for joint in plant.joints}
    require_running_stamps(recording.path, series)
    joints = tuple(joint for joint, name in names.items() if name in series.names)
    if not joints:
        raise InputError(
            f'{recording.path}: {series.topic} commands {", ".join(series.names) or "nothing"}, '
            f'the plant has {", ".join(names.values())}'
        )
    chosen = series.select([names[joint] for joint in joints])
    scale = rig.joints.gear if desired else 1.0
    shaft = scale * chosen.require('position')
    furthest = np.abs(shaft).max(axis=0)
    if furthest.max() > rig.motors.reach * ROUNDING:
        worst = joints[int(np.argmax(furthest))]
        raise InputError(
            f'{recording.path}: {series.topic} turns the shaft of {worst} to {furthest.max():.4g} '
            f'rad, beyond the {rig.motors.reach:g} rad of the rig (motors.reach): give angles in '
            'rad, not in degrees, or the rig that has this reach'
        )
    return BagCommands(series.topic, joints, chosen.stamp_ns, shaft)


@dataclass(frozen=True)
class _Times:
    """Header stamp, receipt and publication of the messages of one topic, in ns."""

    topic: str
    stamp_ns: Stamps
    log_ns: Stamps
    publish_ns: Stamps

    def only(self, kept: NDArray[np.bool_]) -> '_Times':
        return replace(
            self,
            stamp_ns=self.stamp_ns[kept],
            log_ns=self.log_ns[kept],
            publish_ns=self.publish_ns[kept],
        )


def write_answer(
    plant: PlantDescription,
    recording: Recording,
    out: Path,
    noise_seed: int | None = None,
    rig: Rig | None = None,
) -> int:
    """Write a bag with the answer of a plant to the commands of a recording; how many messages."""
    # It has the commands as they are and what is measured at the stamps, under the namespace and
    # with the times of receipt of the recording; a topic that the recording lacks comes at its
    # nominal rate. Only joints that are commanded answer. Poses are at the stamps that they share
    # with `slave/measured_js`. Without a seed there is neither noise nor quantisation.
    rig = rig or rig_of_bag(recording)
    commands = commands_of_bag(recording, plant, rig)
    driven = plant.of_joints(commands.joints)
    with BagWriter(out, records=rig_record(rig)) as writer:
        rates = {
            MOTOR: plant.sensors.load_cell_rate,
            WIRES: plant.sensors.load_cell_rate,
            BENDING: plant.sensors.tracker_rate,
        }
        faults, times = recording_faults(driven), {}
        for (suffix, rate), device in zip(rates.items(), TOPICS, strict=True):
            every = _times(recording, commands, suffix, rate)
            since = (every.stamp_ns - commands.stamp_ns[0]) * NANOSECONDS
            times[suffix] = every.only(faults.keeps(device, since))
        stamps = AnswerStamps(*(times[suffix].stamp_ns for suffix in rates))
        answer = _answer_as_stamped(driven, commands, stamps, _recorded_shaft(recording, commands))
        if noise_seed is not None:
            sensors = SensorModel(plant.sensors, noise_seed)
            read = {name: getattr(sensors, name)(clean) for name, clean in vars(answer).items()}
            answer = RigReadings(**read)
        streams = [_copied(recording, suffix) for suffix in INPUT_TOPICS if recording.has(suffix)]
        streams += _encoded(answer, times, commands.joints)
        if recording.has(POSE_TOPIC):
            bending_ns = times[BENDING].stamp_ns
            poses = recording.poses(POSE_TOPIC)
            streams.append(answer_poses(poses, bending_ns, answer.bending, commands.joints))
        kind = _kind(plant, rig, commands)
        writer.add_topic(kind.topic, kind.type, [LATCHED_QOS])
        streams.append(kind)
        writer.write_streams(streams)
        return writer.message_count


def _recorded_shaft(recording: Recording, commands: BagCommands) -> JointStateSeries | None:
    motors = [motor_name(joint) for joint in commands.joints]
    if not recording.has(MOTOR):
        return None
    series = recording.joint_state(MOTOR, finite=())
    if series.position is None or not set(motors) <= set(series.names):
        return None
    return series.select(motors)


def _answer_as_stamped(
    plant: PlantDescription,
    commands: BagCommands,
    stamps: AnswerStamps,
    recorded: JointStateSeries | None,
) -> RigReadings:
    """Answer by the recording's own habit of stamping its readings."""
    # A rig that stamps the beginning of its cycle, commands and then reads, records at a stamp what
    # the command of that stamp has already moved. The shafts, whose encoders are the finest clock,
    # show which habit a recording has.

    def answer(read_delay: float, at: AnswerStamps) -> RigReadings:
        return answer_commands(plant, commands.stamp_ns, commands.shaft, at, read_delay=read_delay)

    if recorded is None:
        return answer(0.0, stamps)
    position = recorded.require('position')
    misfits = [
        float(
            np.nanmean(
                (answer(delay, replace(stamps, motor=recorded.stamp_ns)).shaft_position - position)
                ** 2
            )
        )
        for delay in READ_DELAYS
    ]
    return answer(READ_DELAYS[int(np.argmin(misfits))], stamps)


def _times(recording: Recording, commands: BagCommands, suffix: str, rate: float) -> _Times:
    if recording.has(suffix):
        series = recording.joint_state(suffix, order='recorded', finite=())
        require_running_stamps(recording.path, series)
        return _Times(series.topic, series.stamp_ns, series.log_ns, series.publish_ns)
    first, last = int(commands.stamp_ns[0]), int(commands.stamp_ns[-1])
    stamps = np.arange(first, last + 1, round(1e9 / rate), dtype=np.int64)
    return _Times(commands.namespace + suffix, stamps, stamps, stamps)


def _kind(plant: PlantDescription, rig: Rig, commands: BagCommands) -> MessageStream:
    """Make the entry of the bag that it was simulated, and by what."""
    kind = RigKind(
        Kind.SIMULATED,
        f'endoscope {version("endoscope_explain")}',
        digest(rig_as_text(rig)),
        plant_sha256=digest(plant_as_text(plant)),
    )
    content = [encode_string(kind.as_text())]
    return MessageStream(commands.namespace + RIG_KIND, STRING, content, commands.stamp_ns[:1])


def _copied(recording: Recording, suffix: str) -> MessageStream:
    topic = recording.find(suffix)
    messages = list(recording.messages([topic]))
    return MessageStream(
        topic,
        recording.topics[topic].type,
        [message.data for message in messages],
        np.array([message.log_ns for message in messages], dtype=np.int64),
        np.array([message.publish_ns for message in messages], dtype=np.int64),
    )


def _encoded(
    answer: RigReadings, times: dict[str, _Times], joints: tuple[str, ...]
) -> list[MessageStream]:
    def stream(suffix: str, names: Sequence[str], **readings: Any) -> MessageStream:
        at = times[suffix]
        payloads = encode_joint_states(names, at.stamp_ns, **readings)
        return MessageStream(at.topic, JOINT_STATE, payloads, at.log_ns, at.publish_ns)

    motors = [motor_name(joint) for joint in joints]
    wires = [wire for joint in joints for wire in wire_names(joint)]
    tension = answer.tension.reshape(len(answer.tension), -1)
    return [
        stream(
            MOTOR,
            motors,
            position=answer.shaft_position,
            velocity=answer.shaft_velocity,
            effort=answer.shaft_effort,
        ),
        stream(WIRES, wires, effort=tension),
        stream(BENDING, joints, position=answer.bending),
    ]
