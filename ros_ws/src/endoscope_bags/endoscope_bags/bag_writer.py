"""Writing recordings that `ros2 bag`, Foxglove, PlotJuggler and `rosbags` open as they are."""

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import numpy.typing as npt
from mcap.writer import CompressionType, Writer

from endoscope_bags.bag_files import METADATA
from endoscope_bags.errors import BagExistsError, BagFullError
from endoscope_bags.message_types import MessageType, message_type
from endoscope_bags.qos_profile import QosProfile, qos_as_yaml
from endoscope_bags.room_on_disk import raise_if_full, require_room
from endoscope_bags.rosbag2_metadata import (
    TopicSummary,
    metadata_document,
    metadata_text,
    write_metadata,
)

LIBRARY = 'endoscope_bags'
CHUNK_SECONDS = 0.5
CHUNK_BYTES = 1 << 20
# Upper bounds of what a message, a chunk and a topic add to the file besides the message's bytes.
_MESSAGE_OVERHEAD = 31 + 16
_CHUNK_OVERHEAD = 512
_TOPIC_OVERHEAD = 4096


@dataclass
class _Channel:
    topic: str
    type: MessageType
    qos: tuple[QosProfile, ...]
    mcap_id: int
    count: int = 0


@dataclass(frozen=True)
class MessageStream:
    """Encoded messages of one topic, for `BagWriter.write_streams`.

    Attributes
    ----------
    topic, type
        Full topic name and message type.
    payloads
        N encoded messages.
    log_ns, publish_ns
        Receipt and publication in ns since the epoch, shape (N,).
    """

    topic: str
    type: str
    payloads: Sequence[bytes]
    log_ns: npt.NDArray[np.int64]
    publish_ns: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))


class BagWriter:
    """Writes one recording: a rosbag2 folder, or a bare file where the name ends in ``.mcap``.

    A chunk holds at most half a second, so that a killed writer loses no more than that. Use it as
    a context manager: on an exception the chunks written so far are kept and finished, unless
    `atomic`, then nothing is left behind.

    Parameters
    ----------
    path
        Folder ``NAME`` (holding ``NAME_0.mcap`` and ``metadata.yaml``) or file ``NAME.mcap``.
    atomic
        Write under a temporary name and take the final one on closing. A recorder does not want
        that: what it leaves when it is killed shall be found.
    chunk_seconds, chunk_bytes
        A chunk is closed when it spans this time or exceeds this size, whatever comes first.

    Raises
    ------
    BagExistsError
        Something is there already.
    BagFullError
        There is no room even for the beginning.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        atomic: bool = True,
        chunk_seconds: float = CHUNK_SECONDS,
        chunk_bytes: int = CHUNK_BYTES,
    ) -> None:
        self.path = Path(path)
        if self.path.exists() or self.path.is_symlink():
            raise BagExistsError(f'{self.path}: exists already; recordings are never overwritten')
        self._bare = self.path.suffix == '.mcap'
        self._chunk_ns = round(chunk_seconds * 1e9)
        self._chunk_bytes = chunk_bytes
        self._channels: dict[str, _Channel] = {}
        self._schema_ids: dict[str, int] = {}
        self._pending: list[tuple[int, int, int, int, bytes]] = []
        self._pending_bytes = 0
        self._oldest_ns = 0
        self._n_chunks = 0
        self._start_ns: int | None = None
        self._end_ns = 0
        self._open(atomic)

    def _open(self, atomic: bool) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        hidden = self.path.with_name(f'.partial-{os.getpid()}-{self.path.name}')
        self._home = hidden if atomic else self.path
        self._file_name = self.path.name if self._bare else f'{self.path.name}_0.mcap'
        if not self._bare:
            self._home.mkdir()
        self._file_path = self._home if self._bare else self._home / self._file_name
        self._file = self._file_path.open('xb')
        self._mcap = Writer(
            self._file, chunk_size=1 << 40, compression=CompressionType.ZSTD, enable_crcs=True
        )
        self.closed = False
        try:
            require_room(self._file.fileno(), str(self._file_path), _TOPIC_OVERHEAD)
            self._mcap.start(profile='ros2', library=LIBRARY)
            self._file.flush()
        except (BagFullError, OSError):
            self.discard()
            raise

    @property
    def message_count(self) -> int:
        """Messages accepted so far."""
        return sum(channel.count for channel in self._channels.values())

    @property
    def counts(self) -> dict[str, int]:
        """Messages accepted so far, by topic."""
        return {channel.topic: channel.count for channel in self._channels.values()}

    def add_topic(self, topic: str, type_name: str, qos: Sequence[QosProfile] = ()) -> None:
        """Announce a topic; one without messages is listed, too. Again is harmless.

        Raises
        ------
        UnknownTypeError
            The definition of the type is nowhere to be found.
        """
        if topic in self._channels:
            return
        kind = message_type(type_name)
        schema_id = self._schema_ids.get(kind.name)
        if schema_id is None:
            schema_id = self._mcap.register_schema(kind.name, 'ros2msg', kind.definition.encode())
            self._schema_ids[kind.name] = schema_id
        metadata = {
            'offered_qos_profiles': qos_as_yaml(qos),
            'topic_type_hash': kind.type_hash,
        }
        mcap_id = self._mcap.register_channel(topic, 'cdr', schema_id, metadata)
        self._channels[topic] = _Channel(topic, kind, tuple(qos), mcap_id)

    def write_raw(
        self,
        topic: str,
        type_name: str,
        cdr: bytes,
        log_ns: int,
        publish_ns: int | None = None,
        sequence: int = 0,
    ) -> None:
        """Add one encoded message.

        Parameters
        ----------
        topic, type_name
            Full topic name and message type; the topic is announced if it was not.
        cdr
            The message in CDR.
        log_ns, publish_ns
            Receipt and publication, ns since the epoch; publication defaults to receipt.
        sequence
            The publisher's message counter (modulo 2**32).

        Raises
        ------
        BagFullError
            The disk is full; what came before the chunk in progress is kept, close the writer.
        """
        channel = self._channels.get(topic)
        if channel is None:
            self.add_topic(topic, type_name)
            channel = self._channels[topic]
        if self._pending and (
            self._pending_bytes > self._chunk_bytes
            or abs(log_ns - self._oldest_ns) >= self._chunk_ns
        ):
            self.flush()
        if not self._pending:
            self._oldest_ns = log_ns
        published = log_ns if publish_ns is None else publish_ns
        self._pending.append((log_ns, channel.mcap_id, published, sequence & 0xFFFFFFFF, cdr))
        self._pending_bytes += len(cdr) + _MESSAGE_OVERHEAD
        channel.count += 1

    def write_streams(self, streams: Sequence[MessageStream]) -> None:
        """Add whole topics, merged by receipt (equal ones in the order of `streams`).

        The sequence counts from 1 in each topic, as a publisher does.

        Raises
        ------
        BagFullError
            The disk is full.
        """
        for stream in streams:
            self.add_topic(stream.topic, stream.type)
        which = np.repeat(np.arange(len(streams)), [len(s.payloads) for s in streams])
        row = np.concatenate([np.arange(len(s.payloads)) for s in streams])
        log_ns = np.concatenate([np.asarray(s.log_ns, dtype=np.int64) for s in streams])
        for k in np.argsort(log_ns, kind='stable'):
            stream, index = streams[which[k]], int(row[k])
            published = int(stream.publish_ns[index]) if len(stream.publish_ns) else None
            self.write_raw(
                stream.topic,
                stream.type,
                stream.payloads[index],
                int(log_ns[k]),
                published,
                index + 1,
            )

    def flush(self) -> None:
        """Close the chunk in progress and hand it to the operating system.

        Raises
        ------
        BagFullError
            There is no room for it; the messages of this chunk are dropped and no longer counted.
        """
        if not self._pending:
            return
        pending, self._pending = sorted(self._pending, key=lambda m: m[0]), []
        size, self._pending_bytes = self._pending_bytes, 0
        try:
            require_room(self._file.fileno(), str(self._file_path), size + self._closing_bytes())
        except BagFullError:
            self._uncount(pending)
            raise
        for log_ns, mcap_id, publish_ns, sequence, cdr in pending:
            self._mcap.add_message(mcap_id, log_ns, cdr, publish_ns, sequence)
        try:
            self._mcap.flush()
        except OSError as error:
            self._uncount(pending)
            self._abandon()
            raise_if_full(error, str(self._file_path))
            raise
        self._n_chunks += 1
        first, last = pending[0][0], pending[-1][0]
        self._start_ns = first if self._start_ns is None else min(first, self._start_ns)
        self._end_ns = max(last, self._end_ns)

    def _uncount(self, messages: Sequence[tuple[int, int, int, int, bytes]]) -> None:
        by_id = {channel.mcap_id: channel for channel in self._channels.values()}
        for message in messages:
            by_id[message[1]].count -= 1

    def _abandon(self) -> None:
        """Close the file with half a chunk at its end: to be read by recovery."""
        self.closed = True
        # What is still buffered cannot be written; the caller raises the first error.
        with suppress(OSError):
            self._file.close()

    def _closing_bytes(self) -> int:
        index = (_CHUNK_OVERHEAD + 10 * len(self._channels)) * (self._n_chunks + 2)
        return index + 4 * _TOPIC_OVERHEAD * (len(self._channels) + 1)

    def close(self, custom_data: Mapping[str, str] | None = None) -> None:
        """Finish the recording; harmless when it is closed already.

        Parameters
        ----------
        custom_data
            Free text that goes into `metadata.yaml` and into a metadata record of the file.

        Raises
        ------
        BagFullError
            The last chunk, or the index, had no room. The recording is finished all the same in
            the first case, and can be recovered in the second.
        """
        if self.closed:
            return
        full: BagFullError | None = None
        try:
            self.flush()
        except BagFullError as error:
            if self.closed:
                raise
            full = error
        self._finish(dict(custom_data or {}))
        if full is not None:
            raise full

    def _finish(self, custom_data: dict[str, str]) -> None:
        document = metadata_document(
            [self._file_name],
            [TopicSummary(c.topic, c.type, c.qos, c.count) for c in self._channels.values()],
            start_ns=self._start_ns or 0,
            end_ns=self._end_ns,
            custom_data=custom_data,
        )
        self.closed = True
        try:
            if custom_data:
                self._mcap.add_metadata(LIBRARY, custom_data)
            self._mcap.add_metadata('rosbag2', {'serialized_metadata': metadata_text(document)})
            self._mcap.finish()
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()
            if not self._bare:
                write_metadata(self._home / METADATA, document)
        except OSError as error:
            self._abandon()
            raise_if_full(error, str(self._file_path))
            raise
        if self._home != self.path:
            self._home.rename(self.path)

    def discard(self) -> None:
        """Remove what was written so far."""
        self._abandon()
        self._file_path.unlink(missing_ok=True)
        if not self._bare:
            self._home.rmdir()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is not None and self._home != self.path:
            self.discard()
        else:
            self.close()
