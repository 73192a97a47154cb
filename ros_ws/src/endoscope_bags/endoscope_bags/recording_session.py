"""The recorder without ROS: counts, losses, a full disk, and the report at the end."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from endoscope_bags.bag_writer import CHUNK_SECONDS, BagWriter
from endoscope_bags.errors import BagWriteError
from endoscope_bags.information import LOST_PREFIX
from endoscope_bags.recording import rig_record
from endoscope_bags.sequence_gaps import SequenceGaps
from endoscope_bags.topic import QosProfile
from endoscope_core.atomic_output import with_final_names
from endoscope_core.rig import Rig

_STALE_CHUNK_NS = round(1.25e9 * CHUNK_SECONDS)


class Arrival(NamedTuple):
    """A message that arrived; the order of the fields is the order of recording."""

    received_ns: int  # since the epoch
    topic: int  # number that `RecordingSession.add_topic` gave
    sequence: int  # the publisher's message counter
    published_ns: int  # since the epoch
    data: bytes  # CDR


@dataclass(frozen=True)
class SessionReport:
    """Report on a recording."""

    path: Path
    counts: dict[str, int]  # messages recorded, by topic
    lost: dict[str, int]  # published and not recorded, by topic; 0 for topics without loss
    full: str  # why recording ended early (the disk was full); else empty
    finished: bool  # complete with its summary; if not, `recover` completes it

    @property
    def message_count(self) -> int:
        """Messages recorded."""
        return sum(self.counts.values())

    @property
    def lost_count(self) -> int:
        """Messages lost."""
        return sum(self.lost.values())

    @property
    def complete(self) -> bool:
        """Whether everything that was published is in the recording."""
        return not self.lost_count and not self.full and self.finished

    def __str__(self) -> str:
        where = with_final_names(str(self.path))
        text = f'{where}: {self.message_count} messages, {self.lost_count} lost'
        losses = [f'{topic} {count}' for topic, count in self.lost.items() if count]
        text += f' ({", ".join(losses)})' if losses else ''
        text += f'; {self.full}' if self.full else ''
        return text if self.finished else f'{text}; complete it with `endoscope bag recover`'


@dataclass
class _Source:
    topic: str
    type: str
    # Asked once, when the first message has come: the publishers are known then.
    offered_qos: Callable[[], Sequence[QosProfile]]
    count_publishers: Callable[[], int]  # asked when a message has an unexpected number
    gaps: SequenceGaps
    announced: bool = False


class RecordingSession:
    """One recording while it is made; what a kill leaves at `path` can be recovered."""

    def __init__(
        self,
        path: str | Path,
        *,
        rig: Rig | None = None,
        records: Mapping[str, dict[str, str]] | None = None,
        threaded: bool = True,
    ) -> None:
        first = ({} if rig is None else rig_record(rig)) | dict(records or {})
        self._writer = BagWriter(path, atomic=False, threaded=threaded, records=first)
        self._sources: list[_Source] = []
        self.full = ''  # why it has ended early
        self._ended = 'on request'
        self._more_notes: Mapping[str, str] = {}

    @property
    def path(self) -> Path:
        """The recording."""
        return self._writer.path

    def add_topic(
        self,
        topic: str,
        type_name: str,
        offered_qos: Callable[[], Sequence[QosProfile]] = tuple,
        count_publishers: Callable[[], int] = lambda: 1,
    ) -> int:
        """Announce a topic and return its number."""
        self._sources.append(
            _Source(topic, type_name, offered_qos, count_publishers, SequenceGaps())
        )
        return len(self._sources) - 1

    def accept(self, batch: Iterable[Arrival]) -> None:
        """Record what arrived since the last call; sorted by receipt here."""
        for received_ns, number, sequence, published_ns, data in sorted(batch):
            source = self._sources[number]
            source.gaps.add(sequence, source.count_publishers)
            if self.full:
                continue
            try:
                if not source.announced:
                    self._announce(source)
                self._writer.write_raw(
                    source.topic, source.type, data, received_ns, published_ns, sequence
                )
            except BagWriteError as error:
                self._end_full(error)

    def _announce(self, source: _Source) -> None:
        self._writer.add_topic(source.topic, source.type, source.offered_qos())
        source.announced = True

    def flush_stale(self, now_ns: int) -> None:
        """Hand a chunk to the operating system that no later message has closed by `now_ns`."""
        waiting_since = self._writer.waiting_since_ns
        if self.full or waiting_since is None or now_ns - waiting_since < _STALE_CHUNK_NS:
            return
        try:
            self._writer.flush()
        except BagWriteError as error:
            self._end_full(error)

    def _end_full(self, error: BagWriteError) -> None:
        # What was recorded is finished at once; what still arrives is counted as lost.
        self.full = str(error)
        self._finish()

    def _finish(self) -> None:
        # A writing thread may only now find that the last chunks do not fit; the notes record it.
        try:
            self._writer.settle()
        except BagWriteError as error:
            self.full = str(error)
        try:
            self._writer.close(self._notes())
        except BagWriteError as error:
            self.full = str(error)

    def _notes(self) -> dict[str, str]:
        notes = {'ended': self.full or self._ended, **self._more_notes}
        return notes | {
            f'{LOST_PREFIX}{source.topic}': str(source.gaps.lost) for source in self._sources
        }

    def report(self) -> SessionReport:
        """Return the report so far, or the final one."""
        written = self._writer.counts
        counts = {s.topic: written.get(s.topic, 0) for s in self._sources}
        lost = {s.topic: s.gaps.lost + s.gaps.received - counts[s.topic] for s in self._sources}
        return SessionReport(
            self.path, counts, lost, self.full, self._writer.finished or not self._writer.closed
        )

    def close(
        self, ended: str = 'on request', notes: Mapping[str, str] | None = None
    ) -> SessionReport:
        """Finish the recording, with the reason in its notes; repeated calls are harmless."""
        if not self._writer.closed:
            self._ended = ended
            self._more_notes = dict(notes or {})
            for source in self._sources:
                if not source.announced:
                    self._announce(source)
            self._finish()
        return self.report()


def simulated_receipt_ns(stamp_ns: int | None, last_tick_ns: int, now_ns: int) -> int:
    """Return when a message was received in simulated time; `last_tick_ns` is 0 at the first."""
    if not last_tick_ns:
        return now_ns
    # What is found at a tick came during the tick before, or was sent already in this one by a node
    # that received the clock earlier. The stamp (None for types without one) decides, so that the
    # same simulation is recorded the same whoever was faster.
    return min(now_ns, max(last_tick_ns, stamp_ns or 0))
