"""The `metadata.yaml` of a rosbag2 folder: the files of a recording and their summary.

It is written in version 9 (ROS 2 Jazzy), with every key that it has.
"""

import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from endoscope_bags.errors import BagError, BagNotFoundError
from endoscope_bags.message_types import MessageType
from endoscope_bags.topic import QosProfile
from endoscope_core.errors import FileError
from endoscope_core.schema import load_yaml

METADATA = 'metadata.yaml'
ROS_DISTRO = 'jazzy'
VERSION = 9
SQLITE3 = '.db3'
"""End of the name of a file in the storage that older versions of rosbag2 wrote."""
_ROOT = 'rosbag2_bagfile_information'


def bag_files(path: Path) -> list[Path]:
    """Return the ``.mcap`` files, in order, of a recording that is one or a folder."""
    if not path.exists():
        raise BagNotFoundError(f'{path}: no such file or folder')
    if path.is_file():
        if path.suffix == SQLITE3:
            raise _in_sqlite3(path)
        return [path]
    # The recorder of a folder without metadata was killed.
    if not (path / METADATA).is_file():
        found = sorted(path.glob('*.mcap'))
        if not found:
            old = sorted(path.glob(f'*{SQLITE3}'))
            raise (
                _in_sqlite3(old[0])
                if old
                else BagError(f'{path}: a folder with neither metadata.yaml nor any .mcap in it')
            )
        return found
    files = [path / name for name in _listed_files(path / METADATA)]
    for file in files:
        # What no file can be named, pathlib would complain of in its own words.
        if not os.path.isfile(file):  # noqa: PTH113
            raise BagNotFoundError(f'{file}: missing, though {path / METADATA} lists it')
    return files


def _listed_files(path: Path) -> list[str]:
    """Names of the files that a `metadata.yaml` lists, without their folders."""
    try:
        document = load_yaml(path)
    except FileError as error:
        raise BagError(str(error)) from error
    information = document.get(_ROOT) if isinstance(document, dict) else None
    listed = information.get('relative_file_paths') if isinstance(information, dict) else None
    if not isinstance(information, dict) or not listed:
        raise BagError(f'{path}: not the metadata of a rosbag2 recording')
    storage = information.get('storage_identifier')
    compression = information.get('compression_mode') or 'none'
    if storage == 'sqlite3':
        raise _in_sqlite3(path.parent)
    if storage != 'mcap' or str(compression).lower() != 'none':
        raise BagError(
            f'{path}: storage {storage}, compression mode {compression}: only mcap without '
            'compression of whole files or messages is read; convert it where it was recorded '
            '(ros2 bag convert)'
        )
    if not isinstance(listed, list) or not all(isinstance(name, str) for name in listed):
        raise BagError(f'{path}: relative_file_paths is {listed!r}: it has to list names of files')
    names = [Path(name).name for name in listed]
    if len(set(names)) < len(names):
        raise BagError(f'{path}: relative_file_paths lists a file twice')
    return names


def _in_sqlite3(path: Path) -> BagError:
    source = shlex.quote(str(path))
    return BagError(
        f'{path}: a recording in sqlite3 storage; make an MCAP of it first: '
        f'rosbags-convert --src {source} --dst {source.removesuffix(SQLITE3)}_mcap '
        '--dst-storage mcap'
    )


@dataclass(frozen=True)
class TopicSummary:
    """Metadata of one topic."""

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
    """Return the document that `ros2 bag` expects; `start_ns`, `end_ns` are 0 without messages."""
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
    return {_ROOT: information}


def metadata_text(document: Mapping[str, Any]) -> str:
    """Return the document, in which no part stands twice: yaml-cpp reads no anchors."""
    return yaml.safe_dump(dict(document), sort_keys=False)
