"""Writing recordings that `ros2 bag`, Foxglove, PlotJuggler and `rosbags` open as they are."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from endoscope_bags.chunk_sink import ChunkSink, TopicRecord, write_error
from endoscope_bags.errors import BagExistsError, BagWriteError, MalformedMessageError
from endoscope_bags.mcap_file import MESSAGE_OVERHEAD, ChunkMessage, chunk_message
from endoscope_bags.message_types import MessageType, message_type
from endoscope_bags.metadata import METADATA, TopicSummary, metadata_document, metadata_text
from endoscope_bags.topic import QosProfile
from endoscope_core.atomic_output import make_parent, write_text

CHUNK_SECONDS = 0.25
CHUNK_BYTES = 1 << 20
METADATA_RECORD = 'endoscope_bags'


@dataclass(frozen=True)
class MessageStream:
    """N encoded messages of one topic, for `BagWriter.write_streams`; times in ns."""

    topic: str  # full name
    type: str
    payloads: Sequence[bytes]
    log_ns: npt.NDArray[np.int64]  # receipt since the epoch, (N,)
    publish_ns: npt.NDArray[np.int64] | None = None  # None where it equals receipt

    def __post_init__(self) -> None:
        for times in (self.log_ns, self.published_ns):
            if times.shape != (len(self.payloads),) or times.dtype != np.int64:
                raise ValueError(
                    f'{self.topic}: times {times.dtype} {times.shape} for '
                    f'{len(self.payloads)} messages; int64 of shape (N,) is due'
                )

    @property
    def published_ns(self) -> npt.NDArray[np.int64]:
        """Publication in ns since the epoch, shape (N,)."""
        return self.log_ns if self.publish_ns is None else self.publish_ns


class BagWriter:
    """Writes one recording: a rosbag2 folder, or a bare file where the name ends in ``.mcap``.

    A chunk spans at most `chunk_seconds` of receipt or `chunk_bytes`: a killed writer loses little,
    and a `threaded` one, for callers that must not stall, keeps its process waiting for the
    interpreter for less than a millisecond. As a context manager, on an exception an `atomic`
    writer, which takes its name on closing, leaves nothing behind; another finishes what it has,
    for what recorders leave when they are killed must be found. `records` are metadata records by
    name, which stand before all messages.

    BagExistsError if something is there already; BagWriteError if not even the beginning fits.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        atomic: bool = True,
        chunk_seconds: float = CHUNK_SECONDS,
        chunk_bytes: int = CHUNK_BYTES,
        threaded: bool = False,
        records: Mapping[str, dict[str, str]] | None = None,
    ) -> None:
        self.path = Path(path)
        if self.path.exists() or self.path.is_symlink():
            raise BagExistsError(f'{self.path}: exists already; recordings are never overwritten')
        self.closed = False  # by `close` or `discard`
        self.finished = False  # complete with its summary and metadata
        self._bare = self.path.suffix == '.mcap'
        self._file_name = self.path.name if self._bare else f'{self.path.name}_0.mcap'
        self._chunk_ns = round(chunk_seconds * 1e9)
        self._chunk_bytes = chunk_bytes
        self._topics: dict[str, TopicRecord] = {}
        self._counts: dict[str, int] = {}
        self._new_topics: list[TopicRecord] = []
        self._pending: list[ChunkMessage] = []
        self._pending_bytes = 0
        self._first_ns = 0
        self._home = self._make_home(atomic)
        file_path = self._home if self._bare else self._home / self._file_name
        try:
            self._sink = ChunkSink(file_path, records or {}, threaded=threaded)
        except BagWriteError:
            self._remove_home()
            raise
        except OSError as error:
            self._remove_home()
            raise BagWriteError(f'{file_path}: cannot be created: {error.strerror}') from error

    def _make_home(self, atomic: bool) -> Path:
        hidden = self.path.with_name(f'.partial-{os.getpid()}-{self.path.name}')
        home = hidden if atomic else self.path
        try:
            make_parent(self.path)
            if not self._bare:
                home.mkdir()
        except OSError as error:
            raise BagWriteError(f'{self.path}: cannot be created: {error.strerror}') from error
        return home

    @property
    def counts(self) -> dict[str, int]:
        """Messages accepted so far, by topic; those of a chunk that did not fit are subtracted."""
        lost = self._sink.lost_counts
        return {t: n - lost.get(self._topics[t].id, 0) for t, n in self._counts.items()}

    @property
    def message_count(self) -> int:
        """Messages accepted so far."""
        return sum(self.counts.values())

    @property
    def waiting_since_ns(self) -> int | None:
        """Receipt of the first message of the chunk in progress; None if there is none."""
        return self._first_ns if self._pending else None

    def add_topic(
        self, topic: str, kind: str | MessageType, qos: Sequence[QosProfile] = ()
    ) -> None:
        """Announce a topic, with what its publishers offer; again is harmless.

        UnknownTypeError if `kind` is the name of a type that is defined nowhere.
        """
        if topic in self._topics:
            return
        kind = message_type(kind) if isinstance(kind, str) else kind
        record = TopicRecord(len(self._topics) + 1, topic, kind, tuple(qos))
        self._topics[topic] = record
        self._counts[topic] = 0
        self._new_topics.append(record)

    def write_raw(
        self,
        topic: str,
        type_name: str,
        cdr: bytes,
        log_ns: int,
        publish_ns: int | None = None,
        sequence: int = 0,
    ) -> None:
        """Add one message in CDR, received and published (by default then) at ns since the epoch.

        The topic is announced if it was not; `sequence` is the publisher's counter modulo 2**32.
        BagWriteError if the disk is full, with the chunks before kept: close the writer then.
        MalformedMessageError if a time is negative.
        """
        published = log_ns if publish_ns is None else publish_ns
        if log_ns < 0 or published < 0:
            raise MalformedMessageError(f'{topic}: time {min(log_ns, published)} ns is negative')
        if topic not in self._topics:
            self.add_topic(topic, type_name)
        if self._pending and (
            self._pending_bytes > self._chunk_bytes
            or abs(log_ns - self._first_ns) >= self._chunk_ns
        ):
            self.flush()
        if not self._pending:
            self._first_ns = log_ns
        self._pending.append(
            chunk_message(log_ns, self._topics[topic].id, sequence & 0xFFFFFFFF, published, cdr)
        )
        self._pending_bytes += len(cdr) + MESSAGE_OVERHEAD
        self._counts[topic] += 1

    def write_streams(self, streams: Sequence[MessageStream]) -> None:
        """Add whole topics, merged by receipt (equal ones in the order of `streams`).

        The sequence counts from 1 in each topic, as a publisher does, on from call to call.
        BagWriteError if the disk is full.
        """
        if not streams:
            return
        for stream in streams:
            self.add_topic(stream.topic, stream.type)
        before = [self._counts[stream.topic] for stream in streams]
        which = np.repeat(np.arange(len(streams)), [len(s.payloads) for s in streams])
        row = np.concatenate([np.arange(len(s.payloads)) for s in streams])
        log_ns = np.concatenate([s.log_ns for s in streams])
        publish_ns = np.concatenate([s.published_ns for s in streams])
        order = np.argsort(log_ns, kind='stable')
        columns = (which[order], row[order], log_ns[order], publish_ns[order])
        for k, index, log, publish in zip(*(c.tolist() for c in columns), strict=True):
            stream = streams[k]
            self.write_raw(
                stream.topic,
                stream.type,
                stream.payloads[index],
                log,
                publish,
                before[k] + index + 1,
            )

    def flush(self) -> None:
        """Close the chunk in progress and hand it to the operating system.

        BagWriteError if it or, when threaded, one before did not fit on the disk; its messages are
        dropped and no longer counted.
        """
        pending, self._pending = self._pending, []
        topics, self._new_topics = self._new_topics, []
        size, self._pending_bytes = self._pending_bytes, 0
        if pending or topics:
            self._sink.write(topics, pending, size)

    def settle(self) -> None:
        """Flush, and wait until everything is in the file; BagWriteError as in `flush`."""
        try:
            self.flush()
        finally:
            self._sink.wait()

    def close(self, custom_data: Mapping[str, str] | None = None) -> None:
        """Finish the recording, with free text for its metadata; harmless when that is done.

        BagWriteError if the last chunk did not fit, and the recording is finished all the same, or
        the index did not, and it can be recovered.
        """
        if self.closed:
            return
        self.closed = True
        full: BagWriteError | None = None
        try:
            self.settle()
        except BagWriteError as error:
            full = error
        custom = dict(custom_data or {})
        document = self._document(custom)
        records = {METADATA_RECORD: custom} if custom else {}
        self._sink.finish({**records, 'rosbag2': {'serialized_metadata': metadata_text(document)}})
        try:
            if not self._bare:
                write_text(self._home / METADATA, metadata_text(document))
        except OSError as error:
            raise write_error(error, str(self._home / METADATA)) from error
        if self._home != self.path:
            self._home.rename(self.path)
        self.finished = True
        if full is not None:
            raise full

    def _document(self, custom_data: dict[str, str]) -> dict[str, object]:
        counts = self.counts
        return metadata_document(
            [self._file_name],
            [TopicSummary(t.topic, t.type, t.qos, counts[t.topic]) for t in self._topics.values()],
            start_ns=self._sink.start_ns,
            end_ns=self._sink.end_ns,
            custom_data=custom_data,
        )

    def discard(self) -> None:
        """Remove what was written so far."""
        self.closed = True
        self._sink.abandon()
        self._remove_home()

    def _remove_home(self) -> None:
        if self._bare:
            self._home.unlink(missing_ok=True)
        else:
            (self._home / self._file_name).unlink(missing_ok=True)
            self._home.rmdir()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None and self._home != self.path:
            self.discard()
        else:
            self.close()
