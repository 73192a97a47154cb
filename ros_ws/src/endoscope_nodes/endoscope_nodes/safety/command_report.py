"""What became of the commands that a node was sent."""

import os
from collections.abc import Callable

from endoscope_core.safety import CommandGate, Refusal
from endoscope_nodes.runtime.diagnostics import ERROR, OK, WARN, Report
from endoscope_nodes.runtime.ticker import Ticker

_CARRIED = 0.99
_HALF = 0.5
_STARVED_REPORTS = 2


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
    """What a command gate did, as a diagnostic report; lost commands are told with what helps."""

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
            said = f'{fresh} of {fresh + accepted} commands refused, last: {gate.last_reason}'
            # Whoever sends what is not obeyed believes that he moves something.
            return ERROR if unheeded > accepted else WARN, said, values
        if share < _CARRIED:
            return WARN, starved, values
        return OK, 'commands in order', values
