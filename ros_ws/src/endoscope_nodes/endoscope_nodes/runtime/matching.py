"""Whether the publishers and subscriptions of some nodes have found each other."""

from collections.abc import Sequence

from rclpy.node import Node


def all_matched(nodes: Sequence[Node]) -> bool:
    """Say whether no message between these nodes would be lost from now on.

    Both sides have to know of each other, and each finds the other at its own time. Endpoints of
    other nodes do not count. A node of this process that reads topics by other means than
    subscriptions of its own lists them in ``extra_readers() -> [(topic, publishers found)]``.
    """
    here = {(node.get_name(), node.get_namespace()) for node in nodes}
    for node in nodes:
        for publisher in node.publishers:
            known = node.get_subscriptions_info_by_topic(publisher.topic_name)
            wanted = sum((info.node_name, info.node_namespace) in here for info in known)
            if publisher.get_subscription_count() < wanted:
                return False
        readers = [(s.topic_name, s.get_publisher_count()) for s in node.subscriptions]
        if hasattr(node, 'extra_readers'):
            readers += node.extra_readers()
        for topic, found in readers:
            known = node.get_publishers_info_by_topic(topic)
            if found < sum((info.node_name, info.node_namespace) in here for info in known):
                return False
    return True
