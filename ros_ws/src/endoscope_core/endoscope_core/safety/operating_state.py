"""Operating states of the slave by CRTK, with a fault that latches, and its motion sessions.

States and commands follow the Collaborative Robotics Toolkit (Su et al., IEEE IRC 2020):
``DISABLED``, ``ENABLED``, ``PAUSED``, ``FAULT`` and ``enable``, ``disable``, ``pause``, ``resume``,
``home``.
"""

from dataclasses import dataclass
from enum import StrEnum

UNKNOWN_COMMAND, WRONG_STATE, CAUSES_PRESENT = 'unknown_command', 'wrong_state', 'causes_present'
_NS_PER_MS = 1_000_000


class OperatingState(StrEnum):
    """What the slave may do; it moves only when ``ENABLED``."""

    DISABLED = 'DISABLED'
    ENABLED = 'ENABLED'
    PAUSED = 'PAUSED'
    FAULT = 'FAULT'


class StateCommand(StrEnum):
    """What an operator may ask for."""

    ENABLE = 'enable'
    DISABLE = 'disable'
    PAUSE = 'pause'
    RESUME = 'resume'
    HOME = 'home'


@dataclass(frozen=True)
class Answer:
    """What became of a state command."""

    accepted: bool  # whether it was carried out
    # Why not, in words and as `UNKNOWN_COMMAND`, `WRONG_STATE` or `CAUSES_PRESENT`; empty when
    # accepted.
    reason: str = ''
    code: str = ''


_ALLOWED = {
    StateCommand.ENABLE: {OperatingState.DISABLED, OperatingState.FAULT, OperatingState.ENABLED},
    StateCommand.DISABLE: set(OperatingState),
    StateCommand.PAUSE: {OperatingState.ENABLED, OperatingState.PAUSED},
    StateCommand.RESUME: {OperatingState.PAUSED, OperatingState.ENABLED},
    StateCommand.HOME: {OperatingState.ENABLED},
}

_LEADS_TO = {
    StateCommand.ENABLE: OperatingState.ENABLED,
    StateCommand.DISABLE: OperatingState.DISABLED,
    StateCommand.PAUSE: OperatingState.PAUSED,
    StateCommand.RESUME: OperatingState.ENABLED,
}


class OperatingStateMachine:
    """The one place that decides in which state the slave is, and under which session it moves.

    A fault latches: it stays after its cause has gone, and only an explicit ``enable`` or
    ``disable`` ends it; ``enable`` and ``resume`` are refused while any cause is present. Torque
    can be switched off in every state. Nothing but ``enable`` and ``resume`` leads to ``ENABLED``,
    and each time one of them does, a new motion session is opened; it ends with the state.
    """

    def __init__(self) -> None:
        self.state = OperatingState.DISABLED
        self.session = ''  # empty in every state but ENABLED
        self.cause = ''  # the first cause of a FAULT, empty otherwise
        self._number = 0
        self._present: dict[str, str] = {}

    @property
    def present_causes(self) -> dict[str, str]:
        """Conditions that forbid motion now: name to description."""
        return dict(self._present)

    def command(self, text: str, now_ns: int) -> Answer:
        """Carry out a command, one of :class:`StateCommand`, or say why not.

        A session takes its number from `now_ns`: in ms, and larger than the last, so that no
        session of this or a former supervisor is ever named again.
        """
        try:
            command = StateCommand(text)
        except ValueError:
            known = ', '.join(StateCommand)
            return Answer(
                False, f"unknown state command '{text}'; known are {known}", UNKNOWN_COMMAND
            )
        if self.state not in _ALLOWED[command]:
            extra = f' ({self.cause}); use enable once the cause is gone' if self.cause else ''
            possible = ', '.join(c for c in StateCommand if self.state in _ALLOWED[c])
            words = f"'{command}' is not possible in {self.state}{extra}; possible are {possible}"
            return Answer(False, words, WRONG_STATE)
        if command is StateCommand.HOME:
            return Answer(True)
        state = _LEADS_TO[command]
        if state is OperatingState.ENABLED and self._present:
            return Answer(
                False, f'not enabled: {"; ".join(self._present.values())}', CAUSES_PRESENT
            )
        if state is not OperatingState.ENABLED:
            self.session = ''
        elif not self.session:
            self._number = max(self._number + 1, now_ns // _NS_PER_MS)
            self.session = f'session-{self._number}'
        self.state = state
        self.cause = ''
        return Answer(True)

    def report_cause(self, name: str, description: str) -> bool:
        """Note under a name, and in one line, what forbids motion; whether that changed the state.

        It is a fault if the slave may be moving.
        """
        self._present[name] = description
        if self.state in (OperatingState.ENABLED, OperatingState.PAUSED):
            self.state = OperatingState.FAULT
            self.session = ''
            self.cause = description
            return True
        return False

    def clear_cause(self, name: str) -> None:
        """Note that a condition is gone; a fault stays until ``enable`` or ``disable``."""
        self._present.pop(name, None)
