"""Whether a stream that a node needs is alive."""

from endoscope_nodes.runtime.ticker import Ticker


class StreamWatch:
    """Whether a topic is alive, as far as this process listened to it."""

    def __init__(self, ticker: Ticker, topic: str) -> None:
        self.topic = topic  # name for its troubles
        self._ticker = ticker
        self._heard_ns: int | None = None
        self._late_ns = 0

    def note(self, _: object = None) -> None:
        """Take the topic as heard now; fit to be the callback of a raw subscription."""
        self._heard_ns = self._ticker.monotonic_ns()
        self._late_ns = self._ticker.late_ns

    @property
    def ever_heard(self) -> bool:
        """Whether the stream was heard at all."""
        return self._heard_ns is not None

    def heard(self, timeout_ns: int) -> bool:
        """Whether the stream was heard within ``timeout_ns``."""
        if self._heard_ns is None:
            return False
        age = self._ticker.monotonic_ns() - self._heard_ns
        # A loop that came late has heard nothing meanwhile: its delay is not taken for silence, up
        # to once the time allowed.
        return age - min(self._ticker.late_ns - self._late_ns, timeout_ns) <= timeout_ns

    def trouble(self, timeout_ns: int) -> str:
        """Say what is wrong with the stream; empty if it was heard within ``timeout_ns``."""
        if self.heard(timeout_ns):
            return ''
        if self._heard_ns is None:
            return f'{self.topic} has not been received'
        age = self._ticker.monotonic_ns() - self._heard_ns
        deaf = self._ticker.late_ns - self._late_ns
        late = f', {deaf * 1e-6:.0f} ms of which this process was not run itself' if deaf else ''
        return f'{self.topic} has been silent for {age * 1e-6:.0f} ms{late}'
