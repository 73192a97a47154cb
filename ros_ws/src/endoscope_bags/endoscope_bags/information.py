"""What is in a recording, and what is missing from it: `endoscope bag info`."""

import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from endoscope_bags.bag_writer import METADATA_RECORD
from endoscope_bags.chunk_sink import LIBRARY
from endoscope_bags.message_types import begins_with_header
from endoscope_bags.recording import Recording
from endoscope_bags.sequence_gaps import SequenceGaps
from endoscope_core.errors import printable

LOST_PREFIX = 'lost '
_NUMBER = re.compile('[0-9]{1,18}')
# A silence of this many periods is a dropout; a topic slower than this is not periodic.
_DROPOUT_PERIODS = 2.5
_SLOWEST_PERIOD_S = 0.2
_FEWEST_MESSAGES = 10


@dataclass(frozen=True)
class TopicInformation:
    """One topic of a recording.

    Attributes
    ----------
    name, type
        Full name and message type.
    message_count
        Number of messages.
    rate_hz
        One over the median interval; None for fewer than two messages.
    duration_s
        First to last message.
    dropouts
        Silences longer than 2.5 periods, by header stamp (by publication where there is none); 0
        for topics that are not periodic.
    longest_gap_s
        The longest silence; None for fewer than two messages.
    missing_s
        Total of the dropouts, each less one period.
    lost
        Messages that were published and did not arrive; None where the recorder did not tell.
    """

    name: str
    type: str
    message_count: int
    rate_hz: float | None
    duration_s: float
    dropouts: int
    longest_gap_s: float | None
    missing_s: float
    lost: int | None


@dataclass(frozen=True)
class BagInformation:
    """A recording at a glance; prints itself as a table.

    Attributes
    ----------
    path, library
        What was opened, and which program wrote it.
    start_ns, duration_s
        First receipt (ns since the epoch) and time until the last.
    topics
        By name.
    notes
        What the recorder wrote about the recording.
    damage
        What is wrong with the file; empty for a sound one.
    """

    path: str
    library: str
    start_ns: int
    duration_s: float
    topics: tuple[TopicInformation, ...]
    notes: dict[str, str]
    damage: tuple[str, ...]

    @property
    def message_count(self) -> int:
        """Messages of all topics."""
        return sum(topic.message_count for topic in self.topics)

    @property
    def lost(self) -> int:
        """Messages lost, as far as is known."""
        return sum(topic.lost or 0 for topic in self.topics)

    def __str__(self) -> str:
        begin = np.datetime64(self.start_ns, 'ns')
        lines = [
            f'{self.path}: {self.message_count} messages over {self.duration_s:.3f} s',
            f'from {begin} UTC, written by {self.library or "an unnamed program"}',
        ]
        lines += [f'{key}: {value}' for key, value in self.notes.items()]
        lines += [f'damage: {what}' for what in self.damage]
        head = ('topic', 'type', 'messages', 'rate', 'duration', 'dropouts', 'longest gap', 'lost')
        rows = [head, *(_row(topic) for topic in self.topics)]
        widths = [max(len(row[k]) for row in rows) for k in range(len(head))]
        lines += [
            '  '.join(
                cell.ljust(width) if k < 2 else cell.rjust(width)
                for k, (cell, width) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
            for row in rows
        ]
        return '\n'.join(map(printable, lines))


def _row(topic: TopicInformation) -> tuple[str, ...]:
    dropouts = f'{topic.dropouts} ({topic.missing_s:.3f} s)' if topic.dropouts else '0'
    return (
        topic.name,
        topic.type or '?',
        str(topic.message_count),
        '-' if topic.rate_hz is None else f'{topic.rate_hz:.4g} Hz',
        f'{topic.duration_s:.3f} s',
        dropouts,
        '-' if topic.longest_gap_s is None else f'{topic.longest_gap_s:.4g} s',
        '?' if topic.lost is None else str(topic.lost),
    )


def bag_information(recording: Recording) -> BagInformation:
    """Look through a recording that was opened with `open_bag`."""
    notes = dict(recording.metadata.get(METADATA_RECORD, {}))
    lost = {
        key.removeprefix(LOST_PREFIX): int(notes.pop(key))
        for key in list(notes)
        if key.startswith(LOST_PREFIX) and _NUMBER.fullmatch(notes[key])
    }
    names = sorted(recording.topics)
    stamped = [n for n in names if begins_with_header(recording.topics[n].definition)]
    stamps = dict(zip(stamped, recording.header_stamps(stamped), strict=bool(stamped)))
    topics = tuple(
        _topic_information(recording, name, lost.get(name), stamps.get(name)) for name in names
    )
    start_ns = recording.start_ns
    return BagInformation(
        path=str(recording.path),
        library=recording.library,
        start_ns=start_ns,
        duration_s=(recording.end_ns - start_ns) * 1e-9,
        topics=topics,
        notes=notes,
        damage=recording.damage,
    )


def _topic_information(
    recording: Recording, name: str, lost: int | None, stamps: npt.NDArray[np.int64] | None
) -> TopicInformation:
    topic = recording.topics[name]
    if lost is None and recording.library == LIBRARY:
        gaps = SequenceGaps()
        for sequence in recording.times(name).sequence.tolist():
            gaps.add(sequence)
        lost = gaps.lost
    # Times of the source: header stamps where all messages have them, otherwise publication.
    if stamps is None or len(stamps) != topic.message_count:
        stamps = recording.times(name).publish_ns
    times = np.sort(stamps)
    intervals = np.diff(times) * 1e-9
    period = float(np.median(intervals)) if len(intervals) else None
    periodic = (
        period is not None and len(times) >= _FEWEST_MESSAGES and 0 < period <= _SLOWEST_PERIOD_S
    )
    silent = intervals[intervals > _DROPOUT_PERIODS * period] if periodic and period else ()
    return TopicInformation(
        name=name,
        type=topic.type,
        message_count=topic.message_count,
        rate_hz=1 / period if period else None,
        duration_s=float(times[-1] - times[0]) * 1e-9 if len(times) else 0.0,
        dropouts=len(silent),
        longest_gap_s=float(intervals.max()) if len(intervals) else None,
        missing_s=float(np.sum(silent)) - len(silent) * (period or 0.0),
        lost=lost,
    )
