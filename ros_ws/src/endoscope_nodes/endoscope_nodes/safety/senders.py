"""Whether a topic has but one sender."""

from rclpy.subscription import Subscription

from endoscope_nodes.runtime.endoscope_node import EndoscopeNode


class SenderWatch:
    """Whether a topic has had but one sender since this was last asked.

    A message may wait for a node that is not run and outlive its sender, which is not among those
    who are there when it is taken.  A node killed without a last word counts until the middleware
    has given it up.
    """

    def __init__(self, node: EndoscopeNode, subscription: Subscription) -> None:
        self._node = node
        self._topic = subscription.topic_name
        self._event = node.matched_event(subscription)
        self._there = self._ever = 0

    def rivals(self) -> str:
        """Say who else has been there; empty while there was but one."""
        matched = self._event.take_event()
        been = self._there + matched.total_count - self._ever
        self._there, self._ever = matched.current_count, matched.total_count
        if been <= 1:
            return ''
        relative = self._topic.removeprefix(f'{self._node.get_namespace()}/')
        known = senders_in_words(self._node, self._topic)
        return known or f'{relative} had {been} senders, of which not all are there any more'


def senders_in_words(node: EndoscopeNode, topic: str) -> str:
    """Name all senders of a topic in one line; empty where there are fewer than two."""
    known = [
        f'{info.node_namespace.rstrip("/")}/{info.node_name}'
        for info in node.get_publishers_info_by_topic(topic)
    ]
    if len(known) < 2:
        return ''
    relative = topic.removeprefix(f'{node.get_namespace()}/')
    return f'{relative} has {len(known)} senders: {" and ".join(sorted(known))}'
