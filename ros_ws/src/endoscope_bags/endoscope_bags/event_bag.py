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
from endoscope_bags.recent_messages import RecentMessages, packed, unpacked
from endoscope_bags.recording import EVENT_RECORD
from endoscope_bags.recording_session import Arrival, RecordingSession, SessionReport

FAULT, MARK = 'fault', 'mark'
_NAME = re.compile(rf'({FAULT}|{MARK})-[0-9]{{8}}-[0-9]{{6}}Z(-[0-9]+)?')
_EVENT = re.compile(rf'({FAULT}|{MARK}) at (\S+) UTC: (.*)', re.DOTALL)
_NOTE = 'event '
_WRITTEN_AT_A_TIME = 40
"""Messages; a few times as many as arrive per tick, at little cost."""
_AFTER_NS = 2_000_000_000
"""How long the bag of an event goes on after the last of its events."""
_REASON_NS = 1_500_000_000
"""How long the reason of a fault is waited for; the supervisor reports it at once and every s."""
_AT_ONCE = 2
"""Bags that are written at a time, each with the last seconds until it is written; what happens
beside so many is noted in the last of them."""


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
    """Path for the bag of an event; BagError if there are `most`: none is ever deleted."""
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
    """One bag of an event, from the event to its end, begun once the reason is known.

    A few of the messages before it are written whenever others arrive, so that no caller waits.
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


@dataclass(eq=False)
class _Writing:
    event: EventBag
    begins_ns: int = 0  # at the latest, by the steady clock
    ends_ns: int = 0


class EventKeeping:
    """Keeps the last seconds in memory, for the bag of a fault or of what an operator marks.

    `collect` has what waits to be read handed to :meth:`go_on`, and `notify` takes what came of a
    bag, and whether that is an error. `steady_ns` is by a clock that nobody sets.
    """

    def __init__(
        self,
        recent: RecentMessages,
        most: int,
        folder: Callable[[], Path],
        open_session: Callable[[Path, Mapping[str, dict[str, str]]], RecordingSession],
        collect: Callable[[], None],
        notify: Callable[[str, bool], None],
    ) -> None:
        self._recent, self._most, self._folder = recent, most, folder
        self._open_session, self._collect, self._notify = open_session, collect, notify
        self._writing: list[_Writing] = []
        self._cause = ''  # of the fault that there is, as the supervisor reported last
        self.state = ''  # operating state; empty before the first one is heard
        self.error = ''  # why the last bag is not whole
        self.marks = 0
        self.last = ''  # last bag

    @property
    def events(self) -> list[EventBag]:
        """Whose bags are being written, oldest first."""
        return [writing.event for writing in self._writing]

    def take_state(self, state: str, now_ns: int, steady_ns: int) -> None:
        """Take the operating state: one that becomes ``FAULT`` is an event."""
        before, self.state = self.state, state
        if before and before != state == 'FAULT':
            # Of state and cause, either may come first.
            self._add(FAULT, self._cause, now_ns, steady_ns)
        if state != 'FAULT':
            self._cause = ''

    def mark(self, text: str, now_ns: int, steady_ns: int) -> None:
        """Take what an operator marks; it is noted in a bag that is being written."""
        self.marks += 1
        self._add(MARK, text.strip() or 'by the operator', now_ns, steady_ns)

    def explain(self, cause: str) -> None:
        """Take the cause of a fault, which may be heard before the fault is."""
        self._cause = cause
        lacking = [event for event in self.events if event.lacks_reason]
        if cause and lacking:
            lacking[-1].explain(cause)

    def _add(self, kind: str, reason: str, now_ns: int, steady_ns: int) -> None:
        if not now_ns:
            return
        written = self._writing
        if written and (kind == MARK or len(written) == _AT_ONCE):
            written[-1].event.add(kind, now_ns, reason)
        else:
            self._collect()
            written.append(_Writing(EventBag(self._recent, kind, now_ns, reason)))
        written[-1].begins_ns, written[-1].ends_ns = steady_ns + _REASON_NS, steady_ns + _AFTER_NS
        if reason and written[-1].event.session is None:
            self._begin(written[-1])

    def _begin(self, writing: _Writing) -> None:
        event = writing.event
        try:
            path = new_event_bag(self._folder(), event.kind, self._most)
            event.begin(lambda records: self._open_session(path, records))
        except BagError as error:
            self._writing.remove(writing)
            self._fail(f'no bag of the {event.events[0]}: {error}')
            return
        self.error, self.last = '', str(path)
        self._notify(f'{event.events[0]}: what led to it goes to {path}', False)

    def _fail(self, what: str) -> None:
        self.error = what
        self._notify(what, True)

    def go_on(self, arrivals: list[Arrival], steady_ns: int) -> None:
        """Write what arrived to the bags that are being written, and end each in time."""
        if not self._writing:
            return
        piece = packed(arrivals)
        for writing in list(self._writing):
            event = writing.event
            event.arrive(piece, len(arrivals))
            if event.session is None:
                if not event.lacks_reason or steady_ns >= writing.begins_ns:
                    self._begin(writing)
            elif event.session.full or (steady_ns >= writing.ends_ns and event.caught_up):
                self._end(writing)

    def close(self) -> None:
        """Finish the bags that are being written."""
        if self._writing:
            self._collect()
        for writing in list(self._writing):
            if writing.event.session is None:
                self._begin(writing)
            if writing in self._writing:
                self._end(writing)

    def _end(self, writing: _Writing) -> None:
        self._writing.remove(writing)
        event = writing.event
        report = event.close()
        if report.full or not report.finished:
            self._fail(f'the bag of the {event.events[0]}: {report}')
        else:
            self._notify(str(report), False)
