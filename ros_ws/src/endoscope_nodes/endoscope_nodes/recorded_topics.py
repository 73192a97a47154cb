"""Which topics the recorder takes, what they carry, and with which QoS it asks for them."""

import importlib
from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Header, String

from endoscope_bags.errors import UnknownTypeError
from endoscope_bags.qos_profile import QosProfile
from endoscope_nodes.qos import EVENT, RECORDER_ASKED, RESULT

INTERFACE_TOPICS: dict[str, tuple[type, QoSProfile]] = {
    'master/measured_js': (JointState, RECORDER_ASKED),
    'master/clutch': (Joy, EVENT),
    'slave/servo_jp': (JointState, RECORDER_ASKED),
    'slave/measured_js': (JointState, RECORDER_ASKED),
    'motor/servo_jp': (JointState, RECORDER_ASKED),
    'motor/measured_js': (JointState, RECORDER_ASKED),
    'wires/measured_js': (JointState, RECORDER_ASKED),
    'tracker/measured_cp': (PoseStamped, RECORDER_ASKED),
    'calibration/result': (DiagnosticArray, RESULT),
    'compensator/state': (DiagnosticArray, RESULT),
    'slave/operating_state': (String, RESULT),
    'slave/motion_session': (Header, EVENT),
    'slave/state_command': (String, EVENT),
    '/diagnostics': (DiagnosticArray, EVENT),
}
"""The public topics, each with its type and with what is asked for while nobody offers it yet."""


def message_class(type_name: str) -> type:
    """Import the class of a message type, for example of ``'std_msgs/msg/String'``.

    Raises
    ------
    UnknownTypeError
        The package is not installed or has no such message.
    """
    package, _, name = type_name.partition('/msg/')
    try:
        kind: type = getattr(importlib.import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError) as error:
        raise UnknownTypeError(f'message type {type_name}: not installed') from error
    return kind


def type_name(kind: type) -> str:
    """Return for example ``'std_msgs/msg/String'`` for the class of a message."""
    return f'{kind.__module__.partition(".")[0]}/msg/{kind.__name__}'


def suitable_qos(asked: QoSProfile, publishers: Sequence[TopicEndpointInfo]) -> QoSProfile:
    """Return the QoS that hears every publisher, and latched messages where all are latched.

    Parameters
    ----------
    asked
        What to ask for where the publishers do not decide.
    publishers
        Those known at the moment.
    """
    if not publishers:
        return QoSProfile(
            depth=RECORDER_ASKED.depth,
            history=HistoryPolicy.KEEP_LAST,
            reliability=asked.reliability,
            durability=asked.durability,
        )
    reliable = asked.reliability == ReliabilityPolicy.RELIABLE and all(
        p.qos_profile.reliability == ReliabilityPolicy.RELIABLE for p in publishers
    )
    latched = all(p.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in publishers)
    return QoSProfile(
        depth=RECORDER_ASKED.depth,
        history=HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.RELIABLE
        if reliable or latched
        else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


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
