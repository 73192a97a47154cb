"""Short recordings of one joint of a simulated rig, written as bags."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import BagWriter, MessageStream
from endoscope_bags.cdr import encode_joint_states
from endoscope_core.physics import (
    EffectSpec,
    JointParameters,
    PlantDescription,
    SensorModel,
    simulate,
)
from endoscope_core.rig import load_rig
from endoscope_explain.recording import motor_name, wire_names

Stamps = NDArray[np.int64]

JOINT_STATE = 'sensor_msgs/msg/JointState'
PLANT = PlantDescription(joints={'bend_x': JointParameters()})


def one_joint(*effects: EffectSpec) -> PlantDescription:
    """A rig of one joint, nominal but for the effects."""
    return dataclasses.replace(PLANT, effects=effects)


def write_short_bag(
    path: Path,
    plant: PlantDescription = PLANT,
    duration: float = 4.0,
    seed: int = 1,
    leave_out: str = '',
    spoil: float | None = None,
    restamped: Mapping[str, Callable[[Stamps], Stamps]] | None = None,
    rigs: Sequence[str] = ('rig',),
    tracker_unit: float = 1.0,
) -> Path:
    """Write a recording of a sweep and some steps.

    Parameters
    ----------
    path : Path
    plant : PlantDescription
        Its second joint, if it has one, moves half as far and later.
    duration : float
        In s.
    seed : int
        Of the noise.
    leave_out : str
        Topic that is not written.
    spoil : float, optional
        Written in place of one reading of the tracker.
    restamped : mapping of topic to callable, optional
        What its stamps become in ns; receipt stays as it is.
    rigs : sequence of str
        Namespaces that the same is written under.
    tracker_unit : float
        In which angles are written, in rad.
    """
    restamped = restamped or {}
    time = np.arange(0.0, duration, 1e-3)
    angle = np.where(
        time < 0.7 * duration, 0.9 * np.sin(2.2 * time), 0.4 * np.sign(np.sin(6.0 * time))
    )
    joints = plant.joint_names()
    angles = [angle, 0.5 * np.roll(angle, len(angle) // 3)][: len(joints)]
    command = np.stack(angles, axis=1) * load_rig().joints.gear
    truth, sensors = simulate(plant, command), SensorModel(plant.sensors, seed)
    bending = sensors.bending(truth.bending[::25]) / tracker_unit
    if spoil is not None:
        bending[20, 0] = spoil
    stamps = (time * 1e9).round().astype(np.int64) + 1_700_000_000_000_000_000
    motors = [motor_name(joint) for joint in joints]
    quantities = {
        'motor/servo_jp': (motors, stamps, {'position': command}),
        'motor/measured_js': (
            motors,
            stamps,
            {
                'position': sensors.shaft_position(truth.shaft_position),
                'velocity': sensors.shaft_velocity(truth.shaft_velocity),
                'effort': sensors.shaft_effort(truth.shaft_effort),
            },
        ),
        'wires/measured_js': (
            [wire for joint in joints for wire in wire_names(joint)],
            stamps,
            {'effort': sensors.tension(truth.tension).reshape(len(time), -1)},
        ),
        'slave/measured_js': (joints, stamps[::25], {'position': bending}),
    }
    with BagWriter(path) as bag:
        bag.write_streams(
            [
                MessageStream(
                    f'/{rig}/{topic}',
                    JOINT_STATE,
                    encode_joint_states(names, restamped.get(topic, lambda s: s)(at), **values),
                    at,
                )
                for rig in rigs
                for topic, (names, at, values) in quantities.items()
                if topic != leave_out
            ]
        )
    return path
