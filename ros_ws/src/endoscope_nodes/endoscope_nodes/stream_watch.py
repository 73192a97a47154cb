"""Whether a topic is alive."""

from endoscope_nodes.ticker import Ticker


class StreamWatch:
    """Notes when a topic was heard last.

    Parameters
    ----------
    ticker
        Gives the time.
    topic
        Name for its troubles.
    """

    def __init__(self, ticker: Ticker, topic: str) -> None:
        self.topic = topic
        self._ticker = ticker
        self._heard_ns: int | None = None

    def note(self, _: object = None) -> None:
        """Take the topic as heard now; fit to be the callback of a raw subscription."""
        self._heard_ns = self._ticker.monotonic_ns()

    def trouble(self, timeout_ns: int) -> str:
        """Say what is wrong with the stream; empty if it was heard within ``timeout_ns``."""
        if self._heard_ns is None:
            return f'{self.topic} has not been received'
        age = self._ticker.monotonic_ns() - self._heard_ns
        if age > timeout_ns:
            return f'{self.topic} has been silent for {age * 1e-6:.0f} ms'
        return ''
