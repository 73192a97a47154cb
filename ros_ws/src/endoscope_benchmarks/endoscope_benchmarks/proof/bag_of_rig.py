"""Recordings in memory as bags with the signals of the graph."""

from pathlib import Path

import numpy as np

from endoscope_bags import BagWriter, MessageStream
from endoscope_bags.cdr_encoding import encode_joint_states
from endoscope_bags.message_types import JOINT_STATE
from endoscope_bags.recording import rig_record
from endoscope_explain.recording import (
    BENDING,
    COMMAND,
    MOTOR,
    WIRES,
    Recording,
    Series,
    motor_name,
    wire_names,
)

BEGIN_NS = 1_000_000_000
"""First stamp: a simulation's clock that has run for a second."""


def write_bag(recording: Recording, out: Path) -> None:
    """Write commands, motors, wires and tip at their stamps; BagError if it exists or cannot be."""
    motors = [motor_name(joint) for joint in recording.joints]
    wires = [wire for joint in recording.joints for wire in wire_names(joint)]
    sensors = recording.measured()

    def stream(topic: str, names: list[str], **series: Series) -> MessageStream:
        stamps = BEGIN_NS + np.rint(1e9 * next(iter(series.values())).time).astype(np.int64)
        values = {key: s.values.reshape(len(stamps), -1) for key, s in series.items()}
        payloads = encode_joint_states(
            names,
            stamps,
            position=values.get('position'),
            velocity=values.get('velocity'),
            effort=values.get('effort'),
        )
        return MessageStream(f'/{topic}', JOINT_STATE, payloads, stamps, stamps)

    shaft = {
        key: sensors[f'shaft_{key}']
        for key in ('position', 'velocity', 'effort')
        if f'shaft_{key}' in sensors
    }
    with BagWriter(out, records=rig_record(recording.rig)) as writer:
        writer.write_streams(
            [
                stream(COMMAND, motors, position=recording.command),
                stream(MOTOR, motors, **shaft),
                stream(WIRES, wires, effort=sensors['tension']),
                stream(BENDING, list(recording.joints), position=sensors['bending']),
            ]
        )
