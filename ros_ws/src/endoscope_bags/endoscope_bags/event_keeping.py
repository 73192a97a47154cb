"""Which faults and marks have a bag of their own, and how long each goes on."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from endoscope_bags.errors import BagError
from endoscope_bags.event_bag import FAULT, MARK, EventBag, new_event_bag
from endoscope_bags.recent_messages import RecentMessages, packed
from endoscope_bags.recording_session import Arrival, RecordingSession

_SECOND = 1_000_000_000
_AFTER_NS = 2 * _SECOND
"""How long the bag of an event goes on after the last of its events."""
_REASON_NS = 1_500_000_000
"""How long the reason of a fault is waited for; the supervisor reports it at once and every s."""

_AT_ONCE = 2
"""Bags that are written at a time, each with the last seconds until it is written; what happens
beside so many is noted in the last of them."""


@dataclass(eq=False)
class _Writing:
    event: EventBag
    begins_ns: int = 0  # at the latest, by the steady clock
    ends_ns: int = 0


class EventKeeping:
    """Keeps the last seconds in memory, for the bag of a fault or of what an operator marks.

    `folder` is where the bags go, at most `most` of them, and `open_session` opens one there with
    metadata records. `collect` has what waits to be read handed to :meth:`go_on`, and `notify`
    takes what came of a bag, and whether that is an error. Times in ns: `now_ns` by the clock of
    the recording, `steady_ns` by one that nobody sets.
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
