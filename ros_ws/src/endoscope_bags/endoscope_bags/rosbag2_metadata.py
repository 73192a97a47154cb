"""The `metadata.yaml` of a rosbag2 folder, version 9 (ROS 2 Jazzy), with every key that it has."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from endoscope_bags.message_types import MessageType
from endoscope_bags.qos_profile import QosProfile
from endoscope_core.atomic_output import write_text

ROS_DISTRO = 'jazzy'
VERSION = 9


@dataclass(frozen=True)
class TopicSummary:
    """What the metadata say of one topic."""

    name: str
    type: MessageType
    qos: tuple[QosProfile, ...]
    message_count: int


def metadata_document(
    files: Sequence[str],
    topics: Sequence[TopicSummary],
    *,
    start_ns: int,
    end_ns: int,
    custom_data: Mapping[str, str],
) -> dict[str, Any]:
    """Return the document that `ros2 bag` expects.

    Parameters
    ----------
    files
        Names of the ``.mcap`` files; this project writes one.
    topics
        All topics, also those without messages.
    start_ns, end_ns
        First and last receipt, ns since the epoch; both 0 for a recording without messages.
    custom_data
        Free text by free keys.
    """
    count = sum(topic.message_count for topic in topics)
    start = {'nanoseconds_since_epoch': start_ns}
    duration = {'nanoseconds': end_ns - start_ns}
    information = {
        'version': VERSION,
        'storage_identifier': 'mcap',
        'duration': duration,
        'starting_time': start,
        'message_count': count,
        'topics_with_message_count': [
            {
                'topic_metadata': {
                    'name': topic.name,
                    'type': topic.type.name,
                    'serialization_format': 'cdr',
                    'offered_qos_profiles': [profile.as_rosbag2() for profile in topic.qos],
                    'type_description_hash': topic.type.type_hash,
                },
                'message_count': topic.message_count,
            }
            for topic in topics
        ],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': list(files),
        'files': [
            {
                'path': file,
                'starting_time': dict(start),
                'duration': dict(duration),
                'message_count': count,
            }
            for file in files
        ],
        'custom_data': dict(custom_data) or None,
        'ros_distro': ROS_DISTRO,
    }
    return {'rosbag2_bagfile_information': information}


def metadata_text(document: Mapping[str, Any]) -> str:
    """Return the document as YAML without anchors, which yaml-cpp would print otherwise."""
    return yaml.dump(dict(document), Dumper=_PlainDumper, sort_keys=False)


def write_metadata(path: Path, document: Mapping[str, Any]) -> None:
    """Write `metadata.yaml` whole or not at all."""
    write_text(path, metadata_text(document))


class _PlainDumper(yaml.SafeDumper):
    def ignore_aliases(self, data: Any) -> bool:
        return True
