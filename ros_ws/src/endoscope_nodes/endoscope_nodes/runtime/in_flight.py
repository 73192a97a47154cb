"""What nodes of one process have sent each other in simulated time and not dealt with yet."""

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence

from rclpy.node import Node


class InFlight:
    """Counts messages on their way, so that no tick begins before all of the last one was heard.

    The middleware hands a message to its readers one after the other. On a busy machine one of them
    may be told of it later than the next tick, which would then depend on the machine.
    """

    def __init__(self) -> None:
        self.count = 0  # once for each reader
        # Called when the last one has been dealt with.
        self.landed: Callable[[], object] = lambda: None
        self._sent: Counter[str] = Counter()
        self._readers: defaultdict[str, list[Node]] = defaultdict(list)
        self._senders: set[str] = set()

    def sent_by_us(self, topic: str) -> bool:
        """Whether a node of this process sends on a topic, given by its full name."""
        return topic in self._senders

    def sent[M](self, topic: str, publish: Callable[[M], None]) -> Callable[[M], None]:
        """Count what is published by a function on a topic."""
        self._senders.add(topic)

        def counted(message: M) -> None:
            readers = len(self._readers[topic])
            self._sent[topic] += readers
            self.count += readers
            publish(message)

        return counted

    def taken[M](
        self, node: Node, topic: str, callback: Callable[[M], object]
    ) -> Callable[[M], None]:
        """Count what a node's callback has dealt with."""
        self._readers[topic].append(node)

        def counted(message: M) -> None:
            try:
                callback(message)
            finally:
                # What comes from another process was not counted.
                if self._sent[topic]:
                    self._sent[topic] -= 1
                    self.count -= 1
                    if not self.count:
                        self.landed()

        return counted

    def forget(self, owners: Sequence[object]) -> None:
        """Expect nothing more of these nodes."""
        for topic, nodes in self._readers.items():
            self._readers[topic] = [node for node in nodes if node not in owners]

    def give_up(self) -> None:
        """Take what has not come for lost."""
        self.count = 0
        self._sent.clear()
