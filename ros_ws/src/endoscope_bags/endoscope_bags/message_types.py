"""Message definitions as `ros2msg` text and RIHS01 hashes, without ROS.

The definitions of common_interfaces and of tf2_msgs come with `rosbags`; any other type is read
from the ``.msg`` files of the installed ROS packages (``share/PACKAGE/msg/TYPE.msg``). Their
generated ``TYPE.json`` has the last word on the hash, because `rosbags` hashes the rare fields of
type char otherwise.
"""

import functools
import json
import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from endoscope_bags.errors import UnknownTypeError

JOINT_STATE = 'sensor_msgs/msg/JointState'
POSE_STAMPED = 'geometry_msgs/msg/PoseStamped'
WRENCH_STAMPED = 'geometry_msgs/msg/WrenchStamped'
JOY = 'sensor_msgs/msg/Joy'
STRING = 'std_msgs/msg/String'
DIAGNOSTIC_ARRAY = 'diagnostic_msgs/msg/DiagnosticArray'
CLOCK = 'rosgraph_msgs/msg/Clock'
TF_MESSAGE = 'tf2_msgs/msg/TFMessage'
# The name of a type comes out of files and becomes that of a file.
_NAME = re.compile('[A-Za-z][A-Za-z0-9_]{0,99}/msg/[A-Za-z][A-Za-z0-9_]{0,99}')


@dataclass(frozen=True)
class MessageType:
    """A message type as a recording needs it."""

    name: str  # for example 'sensor_msgs/msg/JointState'
    definition: str  # `ros2msg` text with the definitions of all types that it contains
    type_hash: str  # RIHS01 hash by REP-2016, for example 'RIHS01_a13ee3...'


@functools.cache
def message_type(name: str) -> MessageType:
    """Return definition and hash of a type that `rosbags` or an installed ROS package defines."""
    store = typestore()
    require_type(store, name)
    definition, _ = store.generate_msgdef(name, ros_version=2)
    type_hash = _generated_hash(name) or store.hash_rihs01(name)
    return MessageType(name, definition, type_hash)


@functools.cache
def typestore() -> Typestore:
    """Return the shared `rosbags` store of Jazzy's types, which (de)serialises any of them."""
    return get_typestore(Stores.ROS2_JAZZY)


def begins_with_header(definition: str) -> bool:
    """Return whether the first field of a type is a ``std_msgs/Header``."""
    for line in definition.splitlines():
        code = line.partition('#')[0].split()
        if code and '=' not in line.partition('#')[0]:
            return code[0] in ('std_msgs/Header', 'std_msgs/msg/Header', 'Header')
    return False


def require_type(store: Typestore, name: str) -> None:
    """Add a type and all that it contains to `store` from the installed packages where it lacks."""
    if name in store.fielddefs:
        return
    path = _definition_file(name)
    found = get_types_from_msg(path.read_text(encoding='utf-8'), name)
    for needed in _contained_types(found[name][1]):
        require_type(store, needed)
    store.register(found)


def _contained_types(fields: object) -> Iterator[str]:
    # A field is (name, descriptor) and a descriptor nests: (NAME, 'pkg/msg/Type'),
    # (BASE, ('int32', 0)), (ARRAY | SEQUENCE, (descriptor, length)).
    for _, descriptor in fields:  # type: ignore[attr-defined]
        kind, content = descriptor
        while kind.name in ('ARRAY', 'SEQUENCE'):
            kind, content = content[0]
        if kind.name == 'NAME':
            yield content


def _definition_file(name: str) -> Path:
    path = _installed_file(name, '.msg')
    if path is None:
        package = name.partition('/')[0]
        raise UnknownTypeError(
            f'message type {name}: no installed ROS package defines it; install or source {package}'
        )
    return path


def _generated_hash(name: str) -> str | None:
    path = _installed_file(name, '.json')
    if path is None:
        return None
    hashes = json.loads(path.read_text(encoding='utf-8'))['type_hashes']
    return next((h['hash_string'] for h in hashes if h['type_name'] == name), None)


def _installed_file(name: str, suffix: str) -> Path | None:
    if not _NAME.fullmatch(name):
        return None
    package, _, kind = name.partition('/msg/')
    sourced = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    for prefix in (*filter(None, sourced), sys.prefix):
        path = Path(prefix) / 'share' / package / 'msg' / f'{kind}{suffix}'
        if path.is_file():
            return path
    return None
