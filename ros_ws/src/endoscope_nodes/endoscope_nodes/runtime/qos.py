"""Quality of service of the interface's topics, as rclpy takes it."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from endoscope_nodes import topics


def profile(qos: topics.Qos) -> QoSProfile:
    """Return what rclpy calls it."""
    return QoSProfile(
        depth=qos.depth,
        history=HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.RELIABLE if qos.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if qos.latched else DurabilityPolicy.VOLATILE,
    )


SENSOR_OFFERED = profile(topics.SENSOR_OFFERED)
SENSOR_ASKED = profile(topics.SENSOR_ASKED)
COMMAND = profile(topics.COMMAND)
RESULT = profile(topics.RESULT)
EVENT = profile(topics.EVENT)
LOCK_STEP = profile(topics.LOCK_STEP)
