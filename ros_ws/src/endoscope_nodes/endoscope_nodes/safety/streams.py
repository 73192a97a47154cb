"""Whether a stream that a node needs is alive, and what became of the commands it was sent."""

import os
from collections.abc import Callable
from typing import Self

from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from endoscope_core.safety import CommandGate, Refusal
from endoscope_nodes.runtime.diagnostics import ERROR, OK, WARN, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.ticker import Ticker

_CARRIED = 0.99
_HALF = 0.5
_STARVED_REPORTS = 2


class StreamWatch:
    """Whether a topic is alive, as far as this process listened to it."""

    def __init__(self, ticker: Ticker, topic: str) -> None:
        self.topic = topic  # name for its troubles
        self._ticker = ticker
        self._heard_ns: int | None = None
        self._late_ns = 0

    @classmethod
    def of(cls, node: EndoscopeNode, topic: str, qos: QoSProfile) -> Self:
        """Watch the JointStates of a topic, whose content does not matter."""
        watch = cls(node.ticker, topic)
        node.create_subscription(JointState, topic, watch.note, qos, raw=True)
        return watch

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


def _who_starves(late_ns: int) -> str:
    load, cores = os.getloadavg()[0], os.cpu_count()
    who = (
        f'this process was not run for {late_ns * 1e-6:.0f} ms'
        if late_ns
        else 'this process was run in time, so the sender was not'
    )
    return (
        f'{who} (load {load:.1f} on {cores} cores); realtime_priority puts the nodes before other '
        'programs, and `graph --check` says which tick_rate is carried'
    )


class CommandReport:
    """What a command gate did, as a diagnostic report, with what helps against lost ones."""

    def __init__(
        self,
        gate: CommandGate,
        ticker: Ticker,
        on_starved: Callable[[str], None] | None = None,
    ) -> None:
        self._gate = gate
        self._ticker = ticker
        self._late_ns = 0
        self._on_starved = on_starved
        self._reported = self._without_clutch = 0
        self._accepted = 0
        self._due = 0.0
        self._starved = 0

    def __call__(self) -> Report:
        """Report counts; a warning if anything was refused or lost since the last report."""
        gate = self._gate
        values: dict[str, object] = {'accepted': gate.accepted}
        values |= {f'refused: {reason}': count for reason, count in gate.refused.items()}
        total = sum(gate.refused.values())
        # Told from old ones, so that a warning ends when its cause does.
        fresh, self._reported = total - self._reported, total
        idle = gate.refused[Refusal.CLUTCH]
        # Not counting what comes while the clutch is not held.
        unheeded = fresh - (idle - self._without_clutch)
        self._without_clutch = idle
        accepted, self._accepted = gate.accepted - self._accepted, gate.accepted
        due, self._due = gate.due - self._due, gate.due
        share = accepted / due if due else 1.0
        values['carried [%]'] = 100.0 * share
        self._starved = self._starved + 1 if share < _HALF else 0
        late_ns, self._late_ns = self._ticker.late_ns - self._late_ns, self._ticker.late_ns
        # The hop that starves is the first whose share is low.
        starved = f'{100.0 * share:.0f} % of {due:.0f} commands arrive: {_who_starves(late_ns)}'
        # A rate of which a half would be carried better.
        if self._starved >= _STARVED_REPORTS and self._on_starved is not None:
            self._on_starved(starved)
        if fresh:
            text = f'{fresh} of {fresh + accepted} commands refused, last: {gate.last_reason}'
            # Whoever sends what is not obeyed believes that he moves something.
            return ERROR if unheeded > accepted else WARN, text, values
        if share < _CARRIED:
            return WARN, starved, values
        return OK, 'commands in order', values
