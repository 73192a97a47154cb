"""What a command gate did, as a diagnostic report."""

from endoscope_core.safety import CommandGate
from endoscope_nodes.diagnostics import OK, WARN, Report


class CommandReport:
    """Tells since-last-time refusals from old ones, so that a warning ends when its cause does."""

    def __init__(self, gate: CommandGate) -> None:
        self._gate = gate
        self._reported = 0

    def __call__(self) -> Report:
        """Report counts; a warning if anything was refused since the last report."""
        gate = self._gate
        values: dict[str, object] = {'accepted': gate.accepted}
        values |= {f'refused: {reason}': count for reason, count in gate.refused.items()}
        total = sum(gate.refused.values())
        fresh, self._reported = total - self._reported, total
        if fresh:
            return WARN, f'{fresh} commands refused, last: {gate.last_reason}', values
        return OK, 'commands in order', values
