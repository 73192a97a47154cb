"""The one maker of publishers and subscriptions: none has an event of the middleware attached.

By default rclpy attaches an event to each, to log a QoS that does not match. Served by an
EventsExecutor such events can dead-lock with Fast DDS (rmw_fastrtps #890), and a publisher that is
destroyed while an executor waits for its events can crash it (rclpy #1644).
"""

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

_NOT_SENT = PublisherEventCallbacks(use_default_callbacks=False)
_NOT_TAKEN = SubscriptionEventCallbacks(use_default_callbacks=False)


class EventlessNode(Node):
    """A node whose publishers and subscriptions wake an executor for messages alone."""

    def create_publisher(
        self, msg_type: type, topic: str, qos_profile: Any, **how: Any
    ) -> Publisher:
        """Offer a topic."""
        return super().create_publisher(
            msg_type, topic, qos_profile, event_callbacks=_NOT_SENT, **how
        )

    def create_subscription(
        self, msg_type: type, topic: str, callback: Callable[..., Any], qos_profile: Any, **how: Any
    ) -> Subscription:
        """Subscribe."""
        return super().create_subscription(
            msg_type, topic, callback, qos_profile, event_callbacks=_NOT_TAKEN, **how
        )
