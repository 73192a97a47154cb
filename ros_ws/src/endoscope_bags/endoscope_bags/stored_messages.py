"""The messages of a recording's files by topic: when they came, and their bytes chunk by chunk."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from endoscope_bags.cdr import Payloads
from endoscope_bags.mcap_scan import McapScan
from endoscope_bags.topic import MessageTimes

IntArray = npt.NDArray[np.int64]


class Block(NamedTuple):
    """A chunk, decompressed, and where in it the messages of some topics are (by their number)."""

    data: bytes
    topic: IntArray
    start: IntArray
    size: IntArray
    log_ns: IntArray
    publish_ns: IntArray
    sequence: IntArray


class StoredMessages:
    """Messages of all files, read on demand."""

    def __init__(self, scans: Sequence[McapScan]) -> None:
        self._scans = tuple(scans)
        # For each file, the rows of each topic in its table of messages.
        self.rows = [_rows_of_topics(scan) for scan in scans]

    def log_ns(self) -> Iterator[IntArray]:
        """Times of receipt in ns since the epoch, of each file that has messages."""
        return (scan.messages.log_ns for scan in self._scans if len(scan.messages))

    def times(self, topic: str) -> MessageTimes:
        """Return receipt, publication and counter of the messages of a full topic name."""
        parts = [
            (scan.messages, rows[topic])
            for scan, rows in zip(self._scans, self.rows, strict=True)
            if topic in rows
        ]
        return MessageTimes(
            *(
                np.concatenate([getattr(messages, key)[index] for messages, index in parts])
                for key in ('log_ns', 'publish_ns', 'sequence')
            )
        )

    def payloads(self, topics: Sequence[str]) -> list[Payloads]:
        """Return the bytes of the messages of each full topic name, as recorded."""
        content = [bytearray() for _ in topics]
        sizes: list[list[int]] = [[] for _ in topics]
        for block in self.blocks(topics):
            ends = block.start + block.size
            rows = zip(block.topic.tolist(), block.start.tolist(), ends.tolist(), strict=True)
            for topic, start, end in rows:
                content[topic] += block.data[start:end]
                sizes[topic].append(end - start)
        arrays = [np.array(each, dtype=np.int64) for each in sizes]
        return [
            Payloads(bytes_, np.cumsum(size) - size, size)
            for bytes_, size in zip(content, arrays, strict=True)
        ]

    def blocks(self, topics: Sequence[str]) -> Iterator[Block]:
        """Read each chunk that holds messages of these topics once."""
        for scan, rows in zip(self._scans, self.rows, strict=True):
            parts = [rows.get(topic, np.empty(0, np.int64)) for topic in topics]
            index = np.concatenate([*parts, np.empty(0, np.int64)])
            in_file_order = np.argsort(index, kind='stable')
            index = index[in_file_order]
            topic = np.repeat(np.arange(len(parts)), [len(p) for p in parts])[in_file_order]
            m = scan.messages
            numbers, first = np.unique(m.block[index], return_index=True)
            ends = np.append(first, len(index))[1:]
            spans = zip(first, ends, scan.block_data(numbers), strict=True)
            for begin, end, (_, data) in spans:
                i = index[begin:end]
                columns = (m.start[i], m.size[i], m.log_ns[i], m.publish_ns[i], m.sequence[i])
                yield Block(data, topic[begin:end], *columns)


def _rows_of_topics(scan: McapScan) -> dict[str, IntArray]:
    """For each topic of a file the rows of its messages in the file's table."""
    names = list(dict.fromkeys(channel.topic for channel in scan.channels.values()))
    numbers = {name: k for k, name in enumerate(names)}
    of_channel = np.zeros(1 << 16, dtype=np.int64)
    for channel in scan.channels.values():
        of_channel[channel.id] = numbers[channel.topic]
    topic = of_channel[scan.messages.channel]
    order = np.argsort(topic, kind='stable')
    bounds = np.searchsorted(topic[order], np.arange(1, len(names)))
    return dict(zip(names, np.split(order, bounds), strict=bool(names)))
