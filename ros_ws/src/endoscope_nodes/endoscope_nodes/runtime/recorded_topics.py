"""How a topic is taken for a recording: its class, the QoS that is asked for, what was offered.

The wheels of `rclpy` come without `tf2_msgs`, and without ``/tf`` few viewers draw a robot: where
no installed package defines `tf2_msgs/msg/TFMessage`, it is on the wire as bytes all the same.
"""

import ctypes
import functools
import importlib
from collections.abc import Sequence
from ctypes import POINTER, Structure, c_bool, c_char_p, c_size_t, c_uint8, c_uint32, c_void_p

from geometry_msgs.msg import TransformStamped
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.type_support import check_for_type_support
from visualization_msgs.msg import MarkerArray

from endoscope_bags.errors import UnknownTypeError
from endoscope_bags.message_types import TF_MESSAGE, message_type
from endoscope_bags.topic import QosProfile
from endoscope_nodes import topics
from endoscope_nodes.runtime.qos import profile

_RMW = 'rmw_fastrtps_cpp'
_CODEC, _MEMBERS = 'rosidl_typesupport_fastrtps_c', 'rosidl_typesupport_introspection_c'
_NAMES = b'tf2_msgs::msg', b'TFMessage'
_Asks = ctypes.CFUNCTYPE(c_void_p, c_void_p)
_Chooses = ctypes.CFUNCTYPE(c_void_p, c_void_p, c_char_p)
_new_capsule = ctypes.PYFUNCTYPE(ctypes.py_object, c_void_p, c_char_p, c_void_p)(
    ('PyCapsule_New', ctypes.pythonapi)
)


def message_class(type_name: str) -> type:
    """Return the class of a message type, for example of ``'std_msgs/msg/String'``."""
    package, _, name = type_name.partition('/msg/')
    try:
        kind: type = getattr(importlib.import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError) as error:
        # Its package is not installed: for bytes alone.
        if type_name == TF_MESSAGE:
            return transform_class()
        raise UnknownTypeError(f'message type {type_name}: not installed') from error
    return kind


def suitable_qos(latched: bool, publishers: Sequence[TopicEndpointInfo]) -> QoSProfile:
    """Return the QoS that hears all publishers, latched if all are; without any, as asked."""
    offered = [p.qos_profile for p in publishers]
    if offered:
        latched = all(q.durability == DurabilityPolicy.TRANSIENT_LOCAL for q in offered)
    reliable = latched or all(q.reliability == ReliabilityPolicy.RELIABLE for q in offered)
    return profile(topics.Qos(topics.RECORDER_ASKED.depth, reliable, latched))


def offered_profiles(publishers: Sequence[TopicEndpointInfo]) -> tuple[QosProfile, ...]:
    """Return what publishers offer, as it is written into recordings."""
    profiles = (p.qos_profile for p in publishers)
    return tuple(
        QosProfile(
            reliability=q.reliability.name.lower(),
            durability=q.durability.name.lower(),
            depth=q.depth,
            history=q.history.name.lower(),
        )
        for q in profiles
    )


class _Support(Structure):
    """`rosidl_message_type_support_t`."""

    _fields_ = (
        *(('identifier', c_char_p), ('data', c_void_p), ('choose', _Chooses)),
        *(('hash', _Asks), ('description', _Asks), ('sources', _Asks)),
    )


class _Callbacks(Structure):
    """`message_type_support_callbacks_t` of rosidl_typesupport_fastrtps_cpp."""

    _fields_ = (('namespace', c_char_p), ('name', c_char_p), ('codec', c_void_p * 5))


class _Member(Structure):
    """`MessageMember` of rosidl_typesupport_introspection_c."""

    _fields_ = (
        *(('name', c_char_p), ('type_id', c_uint8), ('string_bound', c_size_t)),
        *(('support', c_void_p), ('is_key', c_bool), ('is_array', c_bool)),
        *(('array_size', c_size_t), ('is_bound', c_bool), ('offset', c_uint32)),
        ('functions', c_void_p * 7),
    )


class _Members(Structure):
    """`MessageMembers` of rosidl_typesupport_introspection_c."""

    _fields_ = (
        *(('namespace', c_char_p), ('name', c_char_p), ('count', c_uint32), ('size', c_size_t)),
        *(('has_key', c_bool), ('first', POINTER(_Member)), ('functions', c_void_p * 2)),
    )


class _Hash(Structure):
    """`rosidl_type_hash_t`."""

    _fields_ = (('version', c_uint8), ('value', c_uint8 * 32))


class _Description(Structure):
    """`TypeDescription` of a type by its name, without fields and types that it refers to."""

    _fields_ = (
        *(('name', c_char_p), ('size', c_size_t), ('capacity', c_size_t)),
        *(('fields', c_size_t * 3), ('referenced', c_size_t * 3)),
    )


@functools.cache
def transform_class() -> type:
    """Return a class without fields, for bytes; UnknownTypeError unless Fast DDS is in use."""
    # rmw_fastrtps_cpp asks a type for its name and hash, by which DDS matches, and for its members,
    # of which it makes the type object. The type support of `MarkerArray`, a sequence of messages
    # as `TFMessage` is one, is copied and given those. What turns messages into bytes and back is
    # still that of markers, so only bytes may be sent and heard.
    if rclpy_implementation.rclpy_get_rmw_implementation_identifier() != _RMW:
        raise UnknownTypeError(f'message type {TF_MESSAGE}: not installed')
    for kind in (MarkerArray, TransformStamped):
        check_for_type_support(kind)
    codec = _copy(_Support, _generated(_CODEC, 'visualization_msgs', 'MarkerArray'))
    callbacks = _copy(_Callbacks, codec.data)
    codec.data = ctypes.addressof(callbacks)
    inside = _copy(_Support, _generated(_MEMBERS, 'visualization_msgs', 'MarkerArray'))
    members = _copy(_Members, inside.data)
    transforms = _copy(_Member, ctypes.addressof(members.first.contents))
    transforms.name = b'transforms'
    transforms.support = _generated(_MEMBERS, 'geometry_msgs', 'TransformStamped')
    members.first = ctypes.pointer(transforms)
    inside.data = ctypes.addressof(members)
    for named in (callbacks, members):
        named.namespace, named.name = _NAMES
    supports = {_CODEC.encode(): codec, _MEMBERS.encode(): inside}

    version, _, value = message_type(TF_MESSAGE).type_hash.removeprefix('RIHS').partition('_')
    known_by = _Hash(int(version), (c_uint8 * 32)(*bytes.fromhex(value)))
    described = _Description(TF_MESSAGE.encode(), len(TF_MESSAGE), len(TF_MESSAGE) + 1)
    sources = (c_size_t * 3)()
    support = _Support(
        b'endoscope',
        None,
        _Chooses(lambda _, name: ctypes.addressof(supports[name]) if name in supports else None),
        _Asks(lambda _: ctypes.addressof(known_by)),
        _Asks(lambda _: ctypes.addressof(described)),
        _Asks(lambda _: ctypes.addressof(sources)),
    )
    # As that of a generated message, whose metaclass has its type support in a capsule.
    metaclass = type(
        'Metaclass_TFMessage',
        (type(MarkerArray),),
        {
            '_TYPE_SUPPORT': _new_capsule(ctypes.addressof(support), None, None),
            '_kept': (support, supports, callbacks, members, transforms),
        },
    )
    made: type = metaclass('TFMessage', (), {})
    return made


def _generated(kind: str, package: str, name: str) -> int:
    """Address of the type support of an installed message."""
    library = ctypes.CDLL(f'lib{package}__{kind}.so')
    get = getattr(library, f'{kind}__get_message_type_support_handle__{package}__msg__{name}')
    get.restype = c_void_p
    return int(get())


def _copy[S: Structure](kind: type[S], address: int) -> S:
    return kind.from_buffer_copy(kind.from_address(address))
