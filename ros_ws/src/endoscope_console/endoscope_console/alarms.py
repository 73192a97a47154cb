"""Alarms: conditions that need attention, their priority, and latching until acknowledged."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from endoscope_core.errors import EndoscopeError


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
    """Alarms that are shown: those present, and latched ones that were not acknowledged.

    Acknowledging records that an alarm was seen; it neither resolves nor enables anything.
    """

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
