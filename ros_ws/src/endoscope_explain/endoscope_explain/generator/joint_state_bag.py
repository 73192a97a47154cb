"""JointState streams to a bare MCAP file."""

from pathlib import Path

from endoscope_bags import BagWriter, MessageStream
from endoscope_bags.cdr_encoding import encode_joint_states
from endoscope_explain.generator.sensor_readings import Stream

NAMESPACE = '/endoscope'
MESSAGE_TYPE = 'sensor_msgs/msg/JointState'


def write_streams(path: Path, streams: list[Stream]) -> None:
    """Write streams, merged in the order of their log times, to a new MCAP file."""
    with BagWriter(path, chunk_seconds=5.0) as bag:
        bag.write_streams(
            [
                MessageStream(
                    f'{NAMESPACE}/{stream.topic}',
                    MESSAGE_TYPE,
                    encode_joint_states(
                        stream.names,
                        stream.stamps,
                        position=stream.position if stream.position.size else None,
                        velocity=stream.velocity if stream.velocity.size else None,
                        effort=stream.effort if stream.effort.size else None,
                    ),
                    stream.log_times,
                )
                for stream in streams
            ]
        )
