"""What is in a recording, and what is missing from it: `endoscope bag info`."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from endoscope_bags.bag_writer import METADATA_RECORD
from endoscope_bags.chunk_sink import LIBRARY
from endoscope_bags.message_types import begins_with_header
from endoscope_bags.recording import Recording, kind_of_bag
from endoscope_bags.sequence_gaps import SequenceGaps
from endoscope_core.errors import printable
from endoscope_core.rig import RigKind

LOST_PREFIX = 'lost '
_NUMBER = re.compile('[0-9]{1,18}')
# A topic is silent if nothing comes for so many periods; one slower than this is not periodic.
SILENT_PERIODS = 2.5
_SLOWEST_PERIOD_S = 0.2
_FEWEST_MESSAGES = 10
# Several sources that report once a second give a median interval that is nobody's period.
_REGULAR_SHARE = 0.8
_REGULAR = 0.5


@dataclass(frozen=True)
class TopicInformation:
    """One topic of a recording; pauses and gaps are of periodic ones, others have none."""

    name: str
    type: str
    message_count: int
    # One over the median interval; over the mean where the topic is not periodic; None for fewer
    # than two messages.
    rate_hz: float | None
    duration_s: float  # first to last message
    # Silences longer than 2.5 periods, by header stamp (by publication where there is none), in
    # which nothing was published: the sequence numbers are consecutive, or the topic is latched and
    # published on change.
    pauses: int
    paused_s: float  # total of the pauses, each less one period
    gaps: int  # silences in which messages were lost or, where nothing numbers them, may have been
    missing_s: float  # total of the gaps, each less one period
    longest_silence_s: float | None  # None for fewer than two messages
    lost: int | None  # published, but not arrived; None where the recorder did not count


@dataclass(frozen=True)
class BagInformation:
    """Summary of a recording; its text is a table."""

    path: str
    library: str  # the program that wrote it
    start_ns: int  # first receipt, since the epoch
    duration_s: float  # first to last receipt
    topics: tuple[TopicInformation, ...]  # by name
    notes: dict[str, str]  # what the recorder wrote about the recording
    damage: tuple[str, ...]  # empty for a sound file
    rig: RigKind  # simulated, emulated, real or unknown

    @property
    def message_count(self) -> int:
        """Messages of all topics."""
        return sum(topic.message_count for topic in self.topics)

    @property
    def lost(self) -> int:
        """Messages lost, as far as is known."""
        return sum(topic.lost or 0 for topic in self.topics)

    def as_json(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            **vars(self),
            'message_count': self.message_count,
            'lost': self.lost,
            'topics': [vars(topic) for topic in self.topics],
            'rig': self.rig.as_json(),
        }

    def __str__(self) -> str:
        begin = np.datetime64(self.start_ns, 'ns')
        lines = [
            f'{self.path}: {self.message_count} messages over {self.duration_s:.3f} s',
            f'from {begin} UTC, written by {self.library or "an unnamed program"}',
            f'rig: {self.rig}',
        ]
        lines += [f'{key}: {value}' for key, value in self.notes.items()]
        lines += [f'damage: {what}' for what in self.damage]
        head = (
            'topic',
            'type',
            'messages',
            'rate',
            'duration',
            'pauses',
            'gaps',
            'longest silence',
            'lost',
        )
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
    silence = topic.longest_silence_s
    return (
        topic.name,
        topic.type or '?',
        str(topic.message_count),
        '-' if topic.rate_hz is None else f'{topic.rate_hz:.4g} Hz',
        f'{topic.duration_s:.3f} s',
        _counted(topic.pauses, topic.paused_s),
        _counted(topic.gaps, topic.missing_s),
        '-' if silence is None else f'{silence:.4g} s',
        '?' if topic.lost is None else str(topic.lost),
    )


def _counted(silences: int, seconds: float) -> str:
    return f'{silences} ({seconds:.3f} s)' if silences else '0'


def counted_losses(recording: Recording) -> dict[str, int]:
    """Messages that were published and not recorded, by topic, where the recorder counted them."""
    return {
        key.removeprefix(LOST_PREFIX): int(text)
        for key, text in recording.metadata.get(METADATA_RECORD, {}).items()
        if key.startswith(LOST_PREFIX) and _NUMBER.fullmatch(text)
    }


def bag_information(recording: Recording) -> BagInformation:
    """Summarise a recording that was opened with `open_bag`."""
    lost = counted_losses(recording)
    notes = {
        key: text
        for key, text in recording.metadata.get(METADATA_RECORD, {}).items()
        if key.removeprefix(LOST_PREFIX) not in lost
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
        rig=kind_of_bag(recording),
    )


def _topic_information(
    recording: Recording, name: str, lost: int | None, stamps: npt.NDArray[np.int64] | None
) -> TopicInformation:
    topic = recording.topics[name]
    numbered = recording.library == LIBRARY
    lost_before = np.zeros(topic.message_count, dtype=np.int64)
    if numbered:
        gaps = SequenceGaps()
        lost_before[:] = [gaps.add(n) for n in recording.times(name).sequence.tolist()]
        lost = gaps.lost if lost is None else lost
    # Times of the source: header stamps where all messages have them, otherwise publication.
    if stamps is None or len(stamps) != topic.message_count:
        stamps = recording.times(name).publish_ns
    order = np.argsort(stamps, kind='stable')
    intervals = np.diff(stamps[order]) * 1e-9
    period = _period(intervals)
    silent = intervals > SILENT_PERIODS * period if period else np.zeros(len(intervals), bool)
    latched = any(profile.durability == 'transient_local' for profile in topic.qos)
    paused = silent & ((lost_before[order][1:] == 0) if numbered else latched)
    duration = float(intervals.sum())
    mean = duration / len(intervals) if len(intervals) else 0.0
    return TopicInformation(
        name=name,
        type=topic.type,
        message_count=topic.message_count,
        rate_hz=1 / (period or mean) if period or mean else None,
        duration_s=duration,
        pauses=int(paused.sum()),
        paused_s=_less_one_period(intervals[paused], period),
        gaps=int((silent & ~paused).sum()),
        missing_s=_less_one_period(intervals[silent & ~paused], period),
        longest_silence_s=float(intervals.max()) if len(intervals) else None,
        lost=lost,
    )


def _period(intervals: npt.NDArray[np.float64]) -> float | None:
    """Period of a topic in s; None where it has none."""
    if len(intervals) + 1 < _FEWEST_MESSAGES:
        return None
    usual = float(np.median(intervals))
    regular = np.abs(intervals - usual) <= _REGULAR * usual
    periodic = 0.0 < usual <= _SLOWEST_PERIOD_S and regular.mean() >= _REGULAR_SHARE
    return usual if periodic else None


def _less_one_period(silences: npt.NDArray[np.float64], period: float | None) -> float:
    return float(silences.sum()) - len(silences) * (period or 0.0)
