"""Event bags: the seconds before and after a fault or an operator's mark, with the reason.

The reason is in a metadata record before all messages, so that a truncated bag has it too, and,
with all events of that time, among the notes at its end.
"""

import re
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from endoscope_bags.bag_writer import METADATA_RECORD
from endoscope_bags.errors import BagError
from endoscope_bags.recent_messages import RecentMessages, unpacked
from endoscope_bags.recording import EVENT_RECORD
from endoscope_bags.recording_session import Arrival, RecordingSession, SessionReport

FAULT, MARK = 'fault', 'mark'
_NAME = re.compile(rf'({FAULT}|{MARK})-[0-9]{{8}}-[0-9]{{6}}Z(-[0-9]+)?')
_EVENT = re.compile(rf'({FAULT}|{MARK}) at (\S+) UTC: (.*)', re.DOTALL)
_NOTE = 'event '
_WRITTEN_AT_A_TIME = 40
"""Messages; a few times as many as arrive per tick, at little cost."""


@dataclass(frozen=True)
class Event:
    """Why a bag was kept."""

    kind: str  # `FAULT` or `MARK`
    at_ns: int  # since the epoch, by the clock of the recording
    reason: str  # in words; of a mark the operator's text

    def __str__(self) -> str:
        return f'{self.kind} at {np.datetime64(self.at_ns, "ns")} UTC: {self.reason}'


def event_from_text(text: str) -> Event | None:
    """Read what `str` made of an event; None for anything else."""
    found = _EVENT.fullmatch(text)
    if found is None:
        return None
    kind, when, reason = found.groups()
    try:
        at_ns = int(np.datetime64(when, 'ns').astype(np.int64))
    except ValueError:
        return None
    return Event(kind, at_ns, reason)


def events_of(metadata: Mapping[str, Mapping[str, str]]) -> list[Event]:
    """Return the events of a bag's metadata records, first to last."""
    notes = metadata.get(METADATA_RECORD, {})
    texts = [text for key, text in notes.items() if key.startswith(_NOTE)]
    texts = texts or list(metadata.get(EVENT_RECORD, {}).values())
    return [event for event in map(event_from_text, texts) if event is not None]


def event_bags(folder: Path) -> list[Path]:
    """Return the bags of events in a folder, oldest first; none if there is no such folder."""
    there = folder.iterdir() if folder.is_dir() else ()
    return sorted(path for path in there if _NAME.fullmatch(path.name))


def new_event_bag(folder: Path, kind: str, most: int) -> Path:
    """Return the path for the bag of an event; BagError if there are `most` of them already.

    Old bags are never deleted automatically.
    """
    if len(event_bags(folder)) >= most:
        raise BagError(
            f'{folder} has {most} bags of faults and marks already: read them, and move or delete '
            'them; no more are written until then'
        )
    first = folder / f'{kind}-{datetime.now(UTC):%Y%m%d-%H%M%SZ}'
    path, number = first, 2
    while path.exists():
        path, number = first.with_name(f'{first.name}-{number}'), number + 1
    return path


class EventBag:
    """One bag of an event, from the event to its end.

    The messages before it are those in the ring buffer at the event. A few of them are written
    whenever messages arrive, so that no caller waits. Writing starts with `begin`, as a rule once
    the reason is known.
    """

    def __init__(self, recent: RecentMessages, kind: str, at_ns: int, reason: str = '') -> None:
        self.events = [Event(kind, at_ns, reason)]
        self.session: RecordingSession | None = None
        self._waiting: deque[bytes] = deque(recent.pieces)
        self._before = recent.in_force_before

    @property
    def kind(self) -> str:
        """Of the first event."""
        return self.events[0].kind

    @property
    def lacks_reason(self) -> bool:
        """Whether the reason of the last event is not known yet."""
        return not self.events[-1].reason

    def add(self, kind: str, at_ns: int, reason: str = '') -> None:
        """Note another event while this bag is written."""
        self.events.append(Event(kind, at_ns, reason))

    def explain(self, reason: str) -> None:
        """Set the reason of the last event that has none."""
        for index in reversed(range(len(self.events))):
            event = self.events[index]
            if not event.reason:
                self.events[index] = Event(event.kind, event.at_ns, reason)
                return

    def begin(
        self,
        open_session: Callable[[Mapping[str, dict[str, str]]], RecordingSession],
    ) -> None:
        """Begin to write, into a session that is opened with these records and knows all topics."""
        self.session = open_session({EVENT_RECORD: {self.kind: str(self.events[0])}})
        since_ns = self.events[0].at_ns
        if self._waiting:
            since_ns = min(arrival.received_ns for arrival in unpacked(self._waiting[0]))
        self.session.accept(held_since(self._before, since_ns))

    def arrive(self, piece: bytes, count: int) -> None:
        """Queue `count` messages that arrived, and write as many of the queue and a few more."""
        if piece:
            self._waiting.append(piece)
        if self.session is not None:
            self._write(count + _WRITTEN_AT_A_TIME)

    def _write(self, least: float) -> None:
        assert self.session is not None
        written = 0
        while self._waiting and written < least:
            batch = list(unpacked(self._waiting.popleft()))
            self.session.accept(batch)
            written += len(batch)

    @property
    def caught_up(self) -> bool:
        """Whether all that arrived is written."""
        return self.session is not None and not self._waiting

    def close(self) -> SessionReport:
        """Write the rest of the queue, and finish the bag with all its events in the notes."""
        assert self.session is not None
        self._write(float('inf'))
        notes = {f'{_NOTE}{n}': str(event) for n, event in enumerate(self.events, start=1)}
        return self.session.close(f'after a {self.kind}', notes)


def held_since(arrivals: Iterable[Arrival], since_ns: int) -> Sequence[Arrival]:
    """Return messages that were in force at a time as the first ones of a recording from then."""
    return [arrival._replace(received_ns=since_ns) for arrival in arrivals]
