"""Saves what is sound of a recording that was cut off or damaged."""

from dataclasses import dataclass
from pathlib import Path

from endoscope_bags.bag_writer import BagWriter
from endoscope_bags.message_types import MessageType
from endoscope_bags.recording import Recording, open_bag
from endoscope_bags.rig_record import copied_rig_record
from endoscope_core.errors import printable


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
    with BagWriter(target, records=copied_rig_record(recording)) as writer:
        _copy(recording, writer)
        writer.close({'recovered_from': Path(source).name, **_numbered(recording.damage)})
        counts = writer.counts
    return RecoveryReport(
        recording.message_count, counts, recording.start_ns, recording.end_ns, recording.damage
    )


def _copy(recording: Recording, writer: BagWriter) -> None:
    for topic in recording.topics.values():
        kind = MessageType(topic.type, topic.definition, topic.type_hash)
        writer.add_topic(topic.name, kind, topic.qos)
    for message in recording.stored_messages():
        kind_name = recording.topics[message.topic].type
        writer.write_raw(
            message.topic,
            kind_name,
            message.data,
            message.log_ns,
            message.publish_ns,
            message.sequence,
        )


def _numbered(damage: tuple[str, ...]) -> dict[str, str]:
    return {f'damage_{number}': what for number, what in enumerate(damage, start=1)}
