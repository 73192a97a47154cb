"""From a bag to a `Recording`."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from endoscope_bags.errors import BagError, MissingJointError, MissingTopicError
from endoscope_bags.information import losses_told
from endoscope_bags.joint_state_series import JointStateSeries
from endoscope_bags.recording import Recording as Bag
from endoscope_bags.recording import open_bag
from endoscope_bags.rig_record import rig_of_bag
from endoscope_bags.sequence_gaps import SequenceGaps
from endoscope_core.choices import WAIVABLE
from endoscope_core.physics.description import PlantDescription
from endoscope_core.rig import Rig
from endoscope_explain.recording.series import (
    BENDING,
    COMMAND,
    DESIRED,
    MOTOR,
    WIRES,
    Recording,
    Series,
    input_topic,
)
from endoscope_explain.recording.signals import motor_name, wire_names
from endoscope_explain.recording.usable_stamps import require_common_time, without_stray

OPTIONAL = (WIRES,)
"""Those of `WAIVABLE` that many rigs do not have: nobody has to say so."""


class TooShortError(BagError):
    """A topic holds too few messages to be a time series."""


def recording_from_bag(
    path: str | Path,
    plant: PlantDescription,
    *,
    without: Collection[str] = (),
    namespace: str | None = None,
    rig: Rig | None = None,
) -> Recording:
    """Read what analysis needs from a bag, in the order in which it was recorded.

    Parameters
    ----------
    path : str or Path
        rosbag2 folder or `.mcap`.
    plant : PlantDescription
        Its joints are looked for.
    without : collection of str
        Topics of `WAIVABLE` that may be missing.
    namespace : str, optional
        Where several rigs are in one bag.
    rig : Rig, optional
        What was recorded; that which the bag carries by default, or as shipped.

    Returns
    -------
    Recording
        With the joints that all topics have, and what is missing in its notes.

    Raises
    ------
    BagError
        Any of endoscope_bags: the bag is cut, empty, lacks a topic or every joint, holds NaN ...
        Also if its stamps cannot be used.
    FileError
        The rig that the bag carries cannot be read.
    """
    bag = open_bag(path)
    rig = rig or rig_of_bag(bag)
    lacking = [t for t in (WIRES, BENDING, MOTOR) if not bag.has(t, namespace)]
    commanded = input_topic(bag, namespace)
    lacking += [] if commanded else [COMMAND]
    fatal = [t for t in lacking if t not in without and t not in OPTIONAL]
    if fatal:
        raise MissingTopicError(_lacking_message(bag, fatal, namespace))
    notes = [f'{t} was not recorded' for t in lacking]

    def read(topic: str, quantity: str) -> JointStateSeries:
        series = bag.joint_state(topic, namespace=namespace, order='recorded', finite=(quantity,))
        if len(series) < 2:
            raise TooShortError(f'{path}: topic {series.topic} holds {len(series)} message')
        series.require(quantity)
        series, left_out = without_stray(series)
        notes.extend(left_out)
        return series

    command = read(commanded, 'position')
    command_names = {j: motor_name(j) for j in plant.joints}
    if commanded == DESIRED:
        command_names = {j: j for j in plant.joints}
        notes.append(
            f'{COMMAND} was not recorded: {DESIRED} times the gear, {rig.joints.gear:g}, is taken '
            'for it'
        )
    bending = read(BENDING, 'position')
    wires = None if WIRES in lacking else read(WIRES, 'effort')
    motor = None if MOTOR in lacking else read(MOTOR, 'position')

    has = {
        joint: [
            (command, [command_names[joint]]),
            (bending, [joint]),
            *([] if wires is None else [(wires, list(wire_names(joint)))]),
            *([] if motor is None else [(motor, [motor_name(joint)])]),
        ]
        for joint in plant.joints
    }
    joints = []
    for joint, needed in has.items():
        absent = [f'{s.topic} has no {n}' for s, names in needed for n in names if n not in s.names]
        if absent:
            notes.append(f'{joint} is left out: ' + ', '.join(absent))
        else:
            joints.append(joint)
    if not joints:
        raise MissingJointError(f'{path}: no joint is complete: ' + '; '.join(notes))

    every = [s for s in (command, wires, bending, motor) if s is not None]
    require_common_time(path, every)
    counted = losses_told(bag)
    origin_ns = min(int(s.stamp_ns.min()) for s in every)

    def series(topic: str, source: JointStateSeries, names: Sequence[str], key: str) -> Series:
        chosen = source.select(names)
        values = chosen.require(key)
        time = np.asarray((chosen.stamp_ns - origin_ns) * 1e-9, dtype=np.float64)
        if key == 'effort' and topic == WIRES:
            values = values.reshape(len(values), len(joints), 2)
        received = np.asarray((chosen.log_ns - origin_ns) * 1e-9, dtype=np.float64)
        lost = None
        if source.topic in counted:
            gaps = SequenceGaps()
            lost = np.array([gaps.add(n) for n in source.sequence.tolist()], dtype=np.int64)
        made = Series.of(topic, time, np.ascontiguousarray(values), received)
        return replace(made, lost=lost)

    shaft = series(commanded, command, [command_names[j] for j in joints], 'position')
    if commanded == DESIRED:
        shaft = replace(shaft, values=shaft.values * rig.joints.gear)
    motors = dict.fromkeys(('position', 'velocity', 'effort'))
    if motor is not None:
        for key in motors:
            if getattr(motor, key) is None:
                notes.append(f'{MOTOR} has no {key}')
                continue
            motor.check_finite([key])
            motors[key] = series(MOTOR, motor, [motor_name(j) for j in joints], key)
    wire_list = [w for j in joints for w in wire_names(j)]
    return Recording(
        name=Path(path).name.removesuffix('.mcap'),
        origin=origin_ns * 1e-9,
        joints=tuple(joints),
        command=shaft,
        tension=None if wires is None else series(WIRES, wires, wire_list, 'effort'),
        bending=series(BENDING, bending, joints, 'position'),
        shaft_position=motors['position'],
        shaft_velocity=motors['velocity'],
        shaft_effort=motors['effort'],
        notes=tuple(notes),
        rig=rig,
    )


def with_unrecorded(plant: PlantDescription, described: PlantDescription) -> PlantDescription:
    """Return a plant of the recorded joints with the others as they are described."""
    return replace(
        plant,
        joints={name: plant.joints.get(name, joint) for name, joint in described.joints.items()},
        effects=plant.effects + tuple(e for e in described.effects if e.joint not in plant.joints),
        terms=plant.terms + tuple(t for t in described.terms if t.joint not in plant.joints),
    )


def _lacking_message(bag: Bag, topics: Sequence[str], namespace: str | None) -> str:
    text = bag.lacking(*topics, namespace=namespace)
    waivable = [t for t in topics if t in WAIVABLE]
    if waivable and len(waivable) == len(topics):
        text += f'; to explain it all the same give --without {waivable[0]}'
    return text
