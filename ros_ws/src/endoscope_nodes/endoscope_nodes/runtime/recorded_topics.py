"""How a topic is taken for a recording: its class, the QoS that is asked for, what was offered."""

import importlib
from collections.abc import Sequence

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from endoscope_bags.errors import UnknownTypeError
from endoscope_bags.message_types import TF_MESSAGE
from endoscope_bags.qos_profile import QosProfile
from endoscope_nodes import topics
from endoscope_nodes.runtime.qos import profile
from endoscope_nodes.runtime.transform_type import transform_class


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
