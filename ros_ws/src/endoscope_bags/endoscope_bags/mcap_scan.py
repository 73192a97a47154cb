"""The messages of one MCAP file as a table of numbers, found in one pass over its records.

The `mcap` library reads schemas, channels and chunks; only the walk over the messages is done here,
because an analysis wants a hundred thousand of them at once. The pass trusts no index, so it reads
files that were cut off, too. Format: https://mcap.dev/spec.
"""

import mmap
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Header, Metadata, Schema, Statistics

from endoscope_bags.errors import BagError, BagNotFoundError, CorruptBagError
from endoscope_bags.mcap_records import (
    MAGIC,
    MESSAGE_HEAD,
    MESSAGE_HEAD_LENGTH,
    RECORD_HEAD,
    Allowance,
    ChunkError,
    Descriptions,
    ExactStream,
    unpacked,
)

UNSURE_NAMES = 'the names of topics agree with no checksum'
_CRC_STEP = 1 << 24
_MOST_DAMAGE = 100
_LOOKED_AT = 512

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Messages:
    """Places and heads of N messages, in file order; every array is (N,) int64."""

    channel: IntArray
    sequence: IntArray
    log_ns: IntArray
    publish_ns: IntArray
    block: IntArray
    start: IntArray
    size: IntArray

    def __len__(self) -> int:
        return len(self.channel)

    def only(self, chosen: npt.NDArray[np.bool_]) -> 'Messages':
        """The messages chosen, by a mask (N,)."""
        if chosen.all():
            return self
        return Messages(**{key: values[chosen] for key, values in vars(self).items()})


@dataclass
class McapScan:
    """Result of one pass over a file."""

    path: Path
    # Its first record (profile and library).
    header: Header = field(default_factory=lambda: Header('', ''))
    schemas: dict[int, Schema] = field(default_factory=dict)  # by id, like the channels
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: Messages = field(default_factory=lambda: Messages(*[np.empty(0, np.int64)] * 7))
    # Spans (start, stop) of the file that hold messages: bodies of chunk records (True), and runs
    # of messages outside chunks (False).
    blocks: list[tuple[int, int, bool]] = field(default_factory=list)
    # By name; the last record of a name counts.
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)  # one line each; empty for a sound file

    def block_data(self, indices: npt.NDArray[np.int64]) -> Iterator[tuple[int, bytes]]:
        """Read blocks again and yield each with its index, decompressed."""
        with self.path.open('rb') as file:
            for index in indices:
                start, stop, chunked = self.blocks[int(index)]
                file.seek(start)
                data = file.read(stop - start)
                try:
                    yield int(index), unpacked(data) if chunked else data
                except ChunkError as error:
                    raise CorruptBagError(
                        f'{self.path}: chunk at byte {start} changed while it was read: {error}'
                    ) from error


def scan_mcap(path: str | Path, *, salvage: bool = False) -> McapScan:
    """Find all messages of an MCAP file; `salvage` notes what is damaged instead of raising."""
    path = Path(path)
    if not path.is_file():
        raise BagNotFoundError(f'{path}: no such file')
    with path.open('rb') as file:
        size = path.stat().st_size
        if size == 0:
            raise BagError(f'{path}: empty file, not an MCAP recording')
        # Damage may hit the first bytes, too; what is no recording shows by having no records.
        first = file.read(_LOOKED_AT)
        if not first.startswith(MAGIC) and not salvage:
            if _is_text(first):
                raise BagError(
                    f'{path}: text, no recording; a table of measurements is converted first: '
                    f'endoscope convert {path} --propose mapping.yaml'
                )
            raise BagError(f'{path}: not an MCAP recording (wrong first bytes)')
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return _Pass(path, data, salvage).run()


def _is_text(first: bytes) -> bool:
    """Whether a file begins as text does."""
    try:
        # A letter may be cut at the end.
        text = first.decode('utf-16' if first[:2] in (b'\xff\xfe', b'\xfe\xff') else 'utf-8-sig')
    except UnicodeDecodeError as error:
        if error.start < len(first) - 3:
            return False
        text = first[: error.start].decode('utf-8', errors='replace')
    return all(c.isprintable() or c.isspace() for c in text)


class _Pass:
    """State of one pass over the records of a file."""

    def __init__(self, path: Path, data: mmap.mmap, salvage: bool) -> None:
        self.scan = McapScan(path)
        self._data = data
        self._salvage = salvage
        self._allowance = Allowance.of(len(data))
        self._written = Descriptions()
        self._summary = Descriptions()
        self._statistics: Statistics | None = None
        self._data_end: int | None = None
        self._summary_holds = False
        self._corrupt = False  # beyond that the end of the file is missing
        self._n_chunks = 0
        # Channels that are covered by the checksum of a chunk.
        self._in_chunks: set[int] = set()
        self._heads: list[npt.NDArray[np.void]] = []
        self._starts: list[IntArray] = []
        self._blocks: list[int] = []
        self._loose: list[int] = []

    def run(self) -> McapScan:
        position = len(MAGIC)
        whole_head = self._data[:position] == MAGIC
        if not whole_head:
            self._damaged('the first bytes are not those of an MCAP recording')
        ended = False
        while not ended:
            record = self._record(position)
            if record is None:
                self._truncated(position)
                break
            opcode, start, stop = record
            if opcode == Opcode.MESSAGE and self._salvage and self._n_chunks:
                # Behind a wrong length: a piece of a chunk, which no checksum covers.
                self._damaged(f'a message by itself at byte {start}')
            elif opcode == Opcode.MESSAGE and stop - start >= MESSAGE_HEAD_LENGTH:
                self._loose.append(position)
            else:
                self._end_loose_messages(position)
                self._other(opcode, start, stop)
                ended = opcode == Opcode.FOOTER
            position = stop
        if ended and self._data[position : position + len(MAGIC)] != MAGIC:
            self._truncated(position)
        self._end_loose_messages(position)
        self._settle()
        if not (whole_head or len(self.scan.messages)):
            raise BagError(f'{self.scan.path}: not an MCAP recording (wrong first bytes)')
        return self.scan

    def _record(self, position: int) -> tuple[int, int, int] | None:
        """Opcode, start and stop of the record here; None where none can be."""
        start = position + RECORD_HEAD.size
        if start > len(self._data):
            return None
        opcode, length = RECORD_HEAD.unpack_from(self._data, position)
        # A crash of the machine leaves zeros where the file had grown but was not written.
        if opcode == 0 or start + length > len(self._data):
            return None
        return opcode, start, start + length

    def _truncated(self, position: int) -> None:
        self._note(f'ends in the middle, after {position} sound bytes of {len(self._data)}')

    def _damaged(self, what: str) -> None:
        self._corrupt = True
        self._note(what)

    def _note(self, what: str) -> None:
        if not self._salvage:
            raise CorruptBagError(f'{self.scan.path}: {what}; try `endoscope bag recover`')
        if len(self.scan.damage) < _MOST_DAMAGE:
            self.scan.damage.append(what)
        elif len(self.scan.damage) == _MOST_DAMAGE:
            self.scan.damage.append('and more')

    def _other(self, opcode: int, start: int, stop: int) -> None:
        try:
            if opcode == Opcode.CHUNK:
                self._chunk(start, stop)
            elif opcode == Opcode.MESSAGE:
                self._damaged(f'message record at byte {start} is too short')
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                described = self._written if self._data_end is None else self._summary
                described.add(opcode, self._data[start:stop])
            elif opcode == Opcode.HEADER:
                self.scan.header = Header.read(ExactStream(self._data[start:stop]))
            elif opcode == Opcode.METADATA:
                record = Metadata.read(ExactStream(self._data[start:stop]))
                self.scan.metadata[record.name] = record.metadata
            elif opcode == Opcode.STATISTICS:
                self._statistics = Statistics.read(ExactStream(self._data[start:stop]))
            elif opcode == Opcode.DATA_END:
                if self._data_end is not None:
                    raise ValueError('the data ended before')
                self._data_end = stop
                self._check_data(start, stop)
            elif opcode == Opcode.FOOTER:
                self._check_summary(start, stop)
        except (EndOfFile, struct.error, ValueError) as error:
            name = Opcode(opcode).name.lower()
            self._damaged(
                f'{name} record at byte {start} does not decode: {str(error) or "it is too short"}'
            )

    def _checksum(self, begin: int, end: int) -> int:
        actual = 0
        for start in range(begin, end, _CRC_STEP):
            actual = zlib.crc32(self._data[start : min(start + _CRC_STEP, end)], actual)
        return actual

    def _check_data(self, start: int, stop: int) -> None:
        expected = DataEnd.read(ExactStream(self._data[start:stop])).data_section_crc
        if expected not in (0, self._checksum(0, start - RECORD_HEAD.size)):
            self._damaged('the data do not agree with their checksum')

    def _check_summary(self, start: int, stop: int) -> None:
        footer = Footer.read(ExactStream(self._data[start:stop]))
        if self._data_end is None:
            self._damaged('the record that ends the data is missing')
            return
        begin = self._data_end
        if footer.summary_start not in (0, begin):
            self._damaged('the footer does not point to the summary')
        elif footer.summary_crc:
            self._summary_holds = self._checksum(begin, start + 16) == footer.summary_crc
            if not self._summary_holds:
                self._damaged('the summary does not agree with its checksum')

    def _settle(self) -> None:
        """Merge data and summary; where they differ, the one whose checksum holds counts."""
        written, summary = self._written, self._summary
        for kind in ('schemas', 'channels'):
            first_time, again = getattr(written, kind), getattr(summary, kind)
            for number in first_time.keys() & again.keys():
                if first_time[number] != again[number]:
                    self._damaged(f'{kind[:-1]} {number} differs in the summary')
        first, second = (written, summary) if self._summary_holds else (summary, written)
        self.scan.schemas = first.schemas | second.schemas
        self.scan.channels = first.channels | second.channels
        vouched = self._summary_holds or self.scan.channels.keys() <= self._in_chunks
        if self._corrupt and not vouched:
            self._damaged(UNSURE_NAMES)
        messages = self._table()
        counted = self._statistics.message_count if self._statistics else len(messages)
        if counted != len(messages):
            self._damaged(f'{len(messages)} messages where its summary counts {counted}')
        known = np.isin(messages.channel, list(self.scan.channels))
        # A time beyond 2**63 ns (the year 2262) became negative.
        timely = (messages.log_ns >= 0) & (messages.publish_ns >= 0)
        for sound, what in ((known, 'of no channel'), (timely, 'of impossible times')):
            if not sound.all():
                self._damaged(f'{int((~sound).sum())} messages {what}')
        self.scan.messages = messages.only(known & timely)

    def _chunk(self, start: int, stop: int) -> None:
        self._n_chunks += 1
        try:
            records = unpacked(self._data[start:stop], self._allowance)
            positions = self._message_positions(records)
        except ChunkError as error:
            self._damaged(f'chunk {self._n_chunks} at byte {start} is damaged: {error}')
            return
        self._add_block(records, positions, (start, stop, True))

    def _message_positions(self, records: bytes) -> list[int]:
        positions = []
        position = 0
        end = len(records)
        try:
            while position < end:
                if position + RECORD_HEAD.size > end:
                    raise ChunkError(f'its records end after {position} of {end} bytes')
                opcode, length = RECORD_HEAD.unpack_from(records, position)
                following = position + RECORD_HEAD.size + length
                if following > end:
                    raise ChunkError(f'its records end after {position} of {end} bytes')
                self._allowance.take(0, 1)
                if opcode == Opcode.MESSAGE:
                    if length < MESSAGE_HEAD_LENGTH:
                        raise ChunkError(f'a message record of {length} bytes')
                    positions.append(position)
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    if opcode == Opcode.CHANNEL:
                        self._in_chunks.add(
                            int.from_bytes(records[position + 9 : position + 11], 'little')
                        )
                    self._written.add(opcode, records[position + RECORD_HEAD.size : following])
                position = following
        except (ChunkError, EndOfFile, struct.error, ValueError) as error:
            if not self._salvage:
                raise ChunkError(str(error) or 'a record in it is too short') from error
            self._damaged(f'a chunk is sound for {position} bytes only: {error}')
        return positions

    def _end_loose_messages(self, stop: int) -> None:
        if not self._loose:
            return
        start = self._loose[0]
        positions = [position - start for position in self._loose]
        self._loose = []
        self._add_block(self._data[start:stop], positions, (start, stop, False))

    def _add_block(self, data: bytes, positions: list[int], span: tuple[int, int, bool]) -> None:
        self.scan.blocks.append(span)
        if not positions:
            return
        starts = np.array(positions, dtype=np.int64)
        windows = np.lib.stride_tricks.sliding_window_view(
            np.frombuffer(data, dtype=np.uint8), MESSAGE_HEAD.itemsize
        )
        self._heads.append(windows[starts].view(MESSAGE_HEAD)[:, 0])
        self._starts.append(starts + MESSAGE_HEAD.itemsize)
        self._blocks.append(len(self.scan.blocks) - 1)

    def _table(self) -> Messages:
        if not self._heads:
            return self.scan.messages
        heads = np.concatenate(self._heads)
        block = np.repeat(self._blocks, [len(starts) for starts in self._starts])
        size = heads['length'].astype(np.int64) - MESSAGE_HEAD_LENGTH
        return Messages(
            channel=heads['channel'].astype(np.int64),
            sequence=heads['sequence'].astype(np.int64),
            log_ns=heads['log'].astype(np.int64),
            publish_ns=heads['publish'].astype(np.int64),
            block=block.astype(np.int64),
            start=np.concatenate(self._starts),
            size=size,
        )
