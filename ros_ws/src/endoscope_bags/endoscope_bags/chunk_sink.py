"""Writes chunks of messages to the file of a recording, in a thread on request."""

import errno
import fcntl
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from mcap.records import Channel, Schema

from endoscope_bags.errors import BagWriteError
from endoscope_bags.mcap_file import ChunkMessage, McapFile, encode_chunk
from endoscope_bags.message_types import MessageType
from endoscope_bags.topic import QosProfile, qos_as_yaml

_NOT_OFFERED = {errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL}
LIBRARY = 'endoscope_bags'
# What the index of a chunk, and the two descriptions of a topic, take at the end of the file.
_CHUNK_OVERHEAD = 512
_TOPIC_OVERHEAD = 8192
# A disk that cannot keep up is waited for rather than buffered for without bound.
_CHUNKS_IN_FLIGHT = 16


def require_room(descriptor: int, name: str, n_bytes: int) -> None:
    """Raise BagWriteError unless a file, positioned at its end, can grow by `n_bytes`."""
    end = os.lseek(descriptor, 0, os.SEEK_CUR)
    try:
        # Given back at once: this alone asks the disk, the quota and the limit of file sizes
        # together.
        os.posix_fallocate(descriptor, end, n_bytes)
    except OSError as error:
        if error.errno in _NOT_OFFERED:
            return
        raise write_error(error, name) from error
    finally:
        os.ftruncate(descriptor, end)


def write_error(error: OSError, name: str) -> BagWriteError:
    """Return what to raise for an error of the file `name`."""
    return BagWriteError(f'{name}: {error.strerror}; recording ended there')


def is_being_written(path: Path) -> bool:
    """Return whether a `ChunkSink` of any process has a file open."""
    with path.open('rb') as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:  # a disk without locks
            return False
    return False


@dataclass(frozen=True)
class TopicRecord:
    """A topic as the file knows it."""

    id: int
    topic: str
    type: MessageType
    qos: tuple[QosProfile, ...]


class ChunkSink:
    """The file of a recording while it is written; with a thread, errors come with a later call."""

    def __init__(
        self, path: Path, records: Mapping[str, dict[str, str]], *, threaded: bool
    ) -> None:
        self.lost_counts: Counter[int] = Counter()  # by topic id, of the chunks that did not fit
        self.start_ns = 0  # first receipt; 0, like the last in `end_ns`, while the file is empty
        self.end_ns = 0
        self._path = path
        self._n_topics = 0
        self._n_chunks = 0
        self._refused: BagWriteError | None = None
        self._schemas: dict[str, Schema] = {}
        self._worker = ThreadPoolExecutor(1, 'bag_writer') if threaded else None
        self._jobs: list[Future[None]] = []
        self._file = path.open('xb', buffering=0)
        # Held until the file is closed, by whatever end of the process; see `is_being_written`.
        with suppress(OSError):
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        try:
            self._require_room(0)
            self._mcap = McapFile(self._file, LIBRARY)
            for name, content in records.items():
                self._mcap.add_metadata(name, content)
        except (BagWriteError, OSError):
            self.abandon()
            raise

    def write(
        self, topics: Sequence[TopicRecord], messages: Sequence[ChunkMessage], size: int
    ) -> None:
        """Write new topics and a chunk of at most `size` bytes; may raise for an earlier chunk."""
        if self._worker is None:
            self._write(topics, messages, size)
            return
        self._jobs.append(self._worker.submit(self._write, topics, messages, size))
        while self._jobs and (self._jobs[0].done() or len(self._jobs) > _CHUNKS_IN_FLIGHT):
            self._jobs.pop(0).result()

    def wait(self) -> None:
        """Wait until all chunks are written; errors as in `write`, the first one counts."""
        jobs, self._jobs = self._jobs, []
        errors = [error for error in (job.exception() for job in jobs) if error is not None]
        if errors:
            raise errors[0]

    def _write(
        self, topics: Sequence[TopicRecord], messages: Sequence[ChunkMessage], size: int
    ) -> None:
        try:
            self._try_to_write(topics, messages, size)
        except OSError as error:
            self._refused = write_error(error, str(self._path))
            # What was written of the chunk would make the rest of the file unreadable.
            self._file.truncate(self._mcap.position)
            self._file.seek(self._mcap.position)
            raise self._refused from error
        except BagWriteError as error:
            self._refused = error
            raise
        finally:
            if self._refused is not None:
                self.lost_counts.update(message[1] for message in messages)

    def _try_to_write(
        self, topics: Sequence[TopicRecord], messages: Sequence[ChunkMessage], size: int
    ) -> None:
        if self._refused is not None:
            raise self._refused
        self._n_topics += len(topics)
        self._require_room(size)
        for topic in topics:
            self._describe(topic)
        if messages:
            self._add(messages)

    def _describe(self, topic: TopicRecord) -> None:
        kind = topic.type
        if kind.name not in self._schemas:
            self._schemas[kind.name] = self._mcap.add_schema(kind.name, kind.definition)
        self._mcap.add_channel(
            Channel(
                id=topic.id,
                topic=topic.topic,
                message_encoding='cdr',
                schema_id=self._schemas[kind.name].id,
                metadata={
                    'offered_qos_profiles': qos_as_yaml(topic.qos),
                    'topic_type_hash': kind.type_hash,
                },
            )
        )

    def _add(self, messages: Sequence[ChunkMessage]) -> None:
        chunk = encode_chunk(messages)
        self._mcap.add_chunk(chunk)
        first, last = chunk.index.message_start_time, chunk.index.message_end_time
        self.start_ns = min(first, self.start_ns) if self._n_chunks else first
        self.end_ns = max(last, self.end_ns) if self._n_chunks else last
        self._n_chunks += 1

    def _require_room(self, size: int) -> None:
        # Checked before a chunk is written, with space for the summary, so that a file on a full
        # disk can always be finished.
        per_chunk = _CHUNK_OVERHEAD + 10 * self._n_topics
        summary = per_chunk * (self._n_chunks + 2) + _TOPIC_OVERHEAD * (self._n_topics + 2)
        require_room(self._file.fileno(), str(self._path), size + summary)

    def finish(self, metadata: Mapping[str, dict[str, str]]) -> None:
        """Write metadata records and the summary, hand all to the disk, close."""
        if self._worker is not None:
            self._worker.shutdown()
        try:
            for name, content in metadata.items():
                self._mcap.add_metadata(name, content)
            self._mcap.finish()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise write_error(error, str(self._path)) from error
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close the file as it is."""
        if self._worker is not None:
            self._worker.shutdown(cancel_futures=True)
        # The file is given up: whatever closing it still complains of is of no use.
        with suppress(OSError):
            self._file.close()
