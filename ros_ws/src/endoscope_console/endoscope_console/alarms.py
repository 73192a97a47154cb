"""Alarms: their priority, latching until acknowledged, and those that the tip's force raises."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from endoscope_core.errors import EndoscopeError
from endoscope_nodes.client.graph_listener import Health

FORCE = 'tip_force: force'
GUARD = 'compensator: guard'
"""Statuses on ``/diagnostics``."""
SILENT_S = 0.5
"""Silence of the force after which it is not known."""
_LASTS_NS = 1_000_000_000
_UNKNOWN = 'no force: '
_OFF, _YIELDS = 'off', 'yielding'


class Urgency(StrEnum):
    """How urgent an alarm is, by the priorities of IEC 60601-1-8; conformity is not claimed."""

    HIGH = 'high'
    MEDIUM = 'medium'
    LOW = 'low'


@dataclass(frozen=True)
class Alarm:
    """A condition that needs attention."""

    id: str  # by which it is acknowledged
    level: Urgency
    text: str
    latched: bool = False  # stays until it was acknowledged


class Alarms:
    """Alarms that are present, and latched ones until they are acknowledged: seen, not resolved."""

    def __init__(self) -> None:
        self._present: dict[str, Alarm] = {}
        self._kept: dict[str, Alarm] = {}

    def update(self, present: Mapping[str, Alarm]) -> tuple[Alarm, ...]:
        """Take what is present now; those that are shown, most urgent first."""
        for name, alarm in present.items():
            if alarm.latched:
                self._kept[name] = alarm
        self._present = dict(present)
        shown = self._kept | {n: a for n, a in present.items() if not a.latched}
        order = list(Urgency)
        return tuple(sorted(shown.values(), key=lambda a: (order.index(a.level), a.id)))

    def acknowledge(self, name: str) -> None:
        """Take note that an alarm was seen, which ends it unless its cause is still present."""
        if name not in self._kept:
            raise EndoscopeError('there is nothing to acknowledge')
        if name in self._present:
            raise EndoscopeError(f'still present: {self._present[name].text}')
        del self._kept[name]


@dataclass(frozen=True)
class TipState:
    """Whether the force at the tip is known, which itself comes with the pictures."""

    why: str = ''  # why it is not; empty where it is
    visible: float | None = None  # smallest one in N that would be seen; None where it is not known


def tip_state(health: Health | None, age_s: float) -> TipState:
    """The state by the last status, where the force itself was heard `age_s` s ago."""
    if health is None:
        return TipState('silent')
    visible = number(health, 'visible [N]')
    if visible is None:
        return TipState(health.message.removeprefix(_UNKNOWN))
    return TipState('silent') if age_s > SILENT_S else TipState('', visible)


def number(health: Health, key: str) -> float | None:
    """A value of a status; None where it is missing or not finite."""
    try:
        value = float(health.values[key])
    except (KeyError, ValueError):
        return None
    return value if math.isfinite(value) else None


class TipAlarms:
    """Alarms of the guard and of a force above `alarm_n` N, which does not flicker.

    It stays for a second after its cause, with the largest force since it began.
    """

    def __init__(self, alarm_n: float) -> None:
        self._alarm_n = alarm_n
        self._most_n = 0.0
        self._until_ns = 0

    def update(self, now_ns: int, push_n: float, guard: Health | None) -> list[Alarm]:
        """Take the newest force that is seen, in N, and what the guard reports; steady ns."""
        if push_n > self._alarm_n:
            self._most_n = max(self._most_n, push_n)
            self._until_ns = now_ns + _LASTS_NS
        elif now_ns > self._until_ns:
            self._most_n = 0.0
        found = []
        if self._most_n:
            text = f'{self._most_n:.2f} N at the tip, above {self._alarm_n:g} N: move it away'
            found.append(Alarm('force', Urgency.HIGH, text))
        state = '' if guard is None else guard.values.get('state', '')
        if guard is not None and state == _YIELDS:
            text = guard.message.partition(': ')[2]
            found.append(Alarm('guard', Urgency.LOW, f'the guard holds the tip back: {text}'))
        elif guard is not None and state == _OFF:
            text = f'the guard of the tip is {guard.message}'
            found.append(Alarm('guard', Urgency.LOW, text))
        return found
