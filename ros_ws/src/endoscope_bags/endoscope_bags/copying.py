"""New recordings out of old ones: a time span with its latched messages, or the sound part."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from endoscope_bags.bag_writer import BagWriter
from endoscope_bags.errors import BagError
from endoscope_bags.information import LOST_PREFIX, counted_losses
from endoscope_bags.message_types import MessageType
from endoscope_bags.recording import Recording, copied_records, open_bag
from endoscope_bags.sequence_gaps import SequenceGaps
from endoscope_bags.topic import RawMessage
from endoscope_core.errors import printable


@dataclass(frozen=True)
class CutReport:
    """What `cut` wrote."""

    message_count: int
    # Topics whose last message before the stretch is kept at its beginning.
    latched: tuple[str, ...]
    seconds: float

    def __str__(self) -> str:
        text = f'{self.message_count} messages over {self.seconds:.3f} s'
        if self.latched:
            text += f'; in force at its beginning: {", ".join(self.latched)}'
        return printable(text)


def cut(source: str | Path, target: str | Path, begin: float, end: float | None) -> CutReport:
    """Write what came from `begin` to `end`, in s from the first receipt, to a new recording."""
    recording = open_bag(source)
    length = (recording.end_ns - recording.start_ns) * 1e-9
    last = length if end is None else end
    if not 0.0 <= begin < last or begin > length:
        raise BagError(
            f'{source}: has no stretch from {begin:g} to {last:g} s; it is {length:.3f} s long'
        )
    first_ns = recording.start_ns + round(begin * 1e9)
    last_ns = recording.end_ns if end is None else recording.start_ns + round(last * 1e9)
    latched = {
        name
        for name, topic in recording.topics.items()
        if topic.qos and all(q.durability == 'transient_local' for q in topic.qos)
    }
    # Of latched topics, the last message before the stretch comes first, as a subscriber who joined
    # then would have heard it; its receipt is the beginning of the stretch.
    in_force: dict[str, RawMessage] = {}
    with BagWriter(target, records=copied_records(recording)) as writer:
        write = _copier(recording, writer)
        for message in recording.messages(sorted(latched)):
            if message.log_ns < first_ns:
                in_force[message.topic] = message
        for message in in_force.values():
            write(message._replace(log_ns=first_ns))
        numbers = {topic: SequenceGaps() for topic in counted_losses(recording)}
        for message in recording.messages():
            if first_ns <= message.log_ns <= last_ns:
                write(message)
                if message.topic in numbers:
                    numbers[message.topic].add(message.sequence)
        count = writer.message_count - len(in_force)
        if not count:
            raise BagError(f'{source}: no message was received from {begin:g} to {last:g} s')
        lost = {f'{LOST_PREFIX}{topic}': str(gaps.lost) for topic, gaps in numbers.items()}
        writer.close({'cut_from': Path(source).name, **lost})
        seconds = (min(last_ns, recording.end_ns) - first_ns) * 1e-9
    return CutReport(count, tuple(sorted(in_force)), seconds)


@dataclass(frozen=True)
class RecoveryReport:
    """What `recover` saved."""

    message_count: int
    counts: dict[str, int]  # messages by topic
    start_ns: int  # first receipt, since the epoch
    end_ns: int  # last receipt
    damage: tuple[str, ...]  # one line each; empty if the recording was sound

    def __str__(self) -> str:
        lines = [f'damage: {what}' for what in self.damage] or ['no damage found']
        seconds = (self.end_ns - self.start_ns) * 1e-9
        lines.append(f'saved {self.message_count} messages over {seconds:.3f} s')
        lines += [f'  {topic}: {count}' for topic, count in sorted(self.counts.items())]
        return '\n'.join(map(printable, lines))


def recover(source: str | Path, target: str | Path) -> RecoveryReport:
    """Write all messages of the sound chunks of a recording to a new one; on an error to none."""
    recording = open_bag(source, salvage=True)
    with BagWriter(target, records=copied_records(recording)) as writer:
        write = _copier(recording, writer)
        for message in recording.stored_messages():
            write(message)
        damage = {f'damage_{n}': what for n, what in enumerate(recording.damage, start=1)}
        writer.close({'recovered_from': Path(source).name, **damage})
        counts = writer.counts
    return RecoveryReport(
        recording.message_count, counts, recording.start_ns, recording.end_ns, recording.damage
    )


def _copier(recording: Recording, writer: BagWriter) -> Callable[[RawMessage], None]:
    """Announce all topics of a recording; what writes a message of it."""
    for topic in recording.topics.values():
        kind = MessageType(topic.type, topic.definition, topic.type_hash)
        writer.add_topic(topic.name, kind, topic.qos)

    def write(message: RawMessage) -> None:
        times = (message.log_ns, message.publish_ns, message.sequence)
        kind = recording.topics[message.topic].type
        writer.write_raw(message.topic, kind, message.data, *times)

    return write
