"""Reading recordings: `open_bag`, and the `Recording` that it returns."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.serde import SerdeError

from endoscope_bags.cdr import HEAD_WITH_STAMP, QUANTITIES, Payloads, stamps_of_heads
from endoscope_bags.errors import BagError, CorruptBagError, MalformedMessageError, UnknownTypeError
from endoscope_bags.joint_state_series import (
    JointStateSeries,
    PoseSeries,
    decode_joint_states,
    decode_poses,
)
from endoscope_bags.mcap_scan import McapScan, scan_mcap
from endoscope_bags.message_types import JOINT_STATE, POSE_STAMPED, STRING, typestore
from endoscope_bags.metadata import bag_files
from endoscope_bags.stored_messages import StoredMessages
from endoscope_bags.topic import MessageTimes, QosProfile, RawMessage, Topic, qos_from_yaml
from endoscope_core.errors import FileError
from endoscope_core.rig import (
    Rig,
    RigKind,
    kind_from_text,
    kind_of_several,
    rig_as_text,
    rig_from_text,
    shipped_rig,
)
from endoscope_core.schema import LARGEST

IntArray = npt.NDArray[np.int64]
_NAME, _KEY = 'endoscope_rig', 'rig.yaml'
"""Of the metadata record, which stands before all messages."""
EVENT_RECORD = 'endoscope_event'
"""Of the record with the reason of an event bag: a fault or an operator's mark."""
RIG_KIND = 'rig/kind'
"""Topic, in whatever namespace, of a std_msgs/String."""


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Put the recording's path before an error that knows only the topic."""
    try:
        yield
    except BagError as error:
        if str(path) in str(error):
            raise
        raise type(error)(f'{path}: {error}') from error


class Recording:
    """A recording that was opened with `open_bag`."""

    def __init__(self, path: Path, scans: Sequence[McapScan], salvage: bool = False) -> None:
        self.path = path  # what was opened
        self._salvage = salvage
        self.library = scans[0].header.library  # program that wrote the first file
        # MCAP metadata records by name.
        self.metadata = {k: v for scan in scans for k, v in scan.metadata.items()}
        # What is wrong, one line each; empty unless it was opened with `salvage`.
        self.damage = tuple(f'{s.path.name}: {what}' for s in scans for what in s.damage)
        self._stored = StoredMessages(scans)
        self.topics: dict[str, Topic] = {}  # by full name
        self._qos: dict[str, tuple[QosProfile, ...]] = {}
        for scan, rows in zip(scans, self._stored.rows, strict=True):
            self._add(scan, dict(rows))

    def _add(self, scan: McapScan, uncounted: dict[str, IntArray]) -> None:
        definitions = {n: s.data.decode(errors='replace') for n, s in scan.schemas.items()}
        for channel in scan.channels.values():
            schema = scan.schemas.get(channel.schema_id)
            before = self.topics.get(channel.topic)
            kind = schema.name if schema else ''
            if before and before.type != kind:
                raise BagError(
                    f'{scan.path}: topic {channel.topic} is both {before.type} and {kind}'
                )
            try:
                qos = self._read_qos(channel.metadata.get('offered_qos_profiles', ''))
            except FileError as error:
                what = f'{scan.path}: topic {channel.topic}: {error}'
                if not self._salvage:
                    raise CorruptBagError(f'{what}; try `endoscope bag recover`') from error
                self.damage = (*self.damage, what)
                qos = ()
            counted = before.message_count if before else 0
            self.topics[channel.topic] = Topic(
                name=channel.topic,
                type=kind,
                message_count=counted + len(uncounted.pop(channel.topic, ())),
                definition=definitions.get(channel.schema_id, ''),
                type_hash=channel.metadata.get('topic_type_hash', ''),
                qos=qos,
            )

    def _read_qos(self, text: str) -> tuple[QosProfile, ...]:
        if text not in self._qos:
            if sum(map(len, self._qos)) + len(text) > LARGEST:
                raise FileError(f'quality of service of more than {LARGEST >> 20} MiB')
            self._qos[text] = qos_from_yaml(text)
        return self._qos[text]

    @property
    def message_count(self) -> int:
        """Number of messages of all topics."""
        return sum(topic.message_count for topic in self.topics.values())

    @property
    def start_ns(self) -> int:
        """First receipt, ns since the epoch."""
        return min(int(t.min()) for t in self._stored.log_ns())

    @property
    def end_ns(self) -> int:
        """Last receipt, ns since the epoch."""
        return max(int(t.max()) for t in self._stored.log_ns())

    def find(self, suffix: str, namespace: str | None = None) -> str:
        """Return the full name of the topic `suffix`, such as ``'motor/measured_js'``.

        It stands under whatever namespace, unless that is given or the name begins with a slash.
        BagError if no topic with messages, or topics under several namespaces, have the name.
        """
        matches = self._matches(suffix, namespace)
        if not matches:
            raise BagError(self.lacking(suffix, namespace=namespace))
        if len(matches) > 1:
            raise BagError(
                f'{self.path}: {suffix} could be {" or ".join(matches)}; give the namespace'
            )
        return matches[0]

    def has(self, suffix: str, namespace: str | None = None) -> bool:
        """Return whether `find` would find at least one topic."""
        return bool(self._matches(suffix, namespace))

    def lacking(self, *suffixes: str, namespace: str | None = None) -> str:
        """Return a message that topics, none of which `has` finds, are empty or missing."""
        empty = [name for suffix in suffixes for name in self._called(suffix, namespace)]
        absent = [suffix for suffix in suffixes if not self._called(suffix, namespace)]
        parts = [f'no message was recorded on {", ".join(empty)}'] if empty else []
        if absent:
            found = ', '.join(n for n in sorted(self.topics) if self.topics[n].message_count)
            parts.append(f'lacks topic {" and ".join(absent)}; it has {found or "none"}')
        return f'{self.path}: {"; ".join(parts)}'

    def _matches(self, suffix: str, namespace: str | None) -> list[str]:
        names = self._called(suffix, namespace)
        return [name for name in names if self.topics[name].message_count]

    def _called(self, suffix: str, namespace: str | None) -> list[str]:
        relative = suffix.strip('/')
        if suffix.startswith('/') or namespace is not None:
            within = (namespace or '').strip('/')
            wanted = f'/{within}/{relative}' if within else f'/{relative}'
            return [wanted] if wanted in self.topics else []
        return sorted(n for n in self.topics if ('/' + n.lstrip('/')).endswith('/' + relative))

    def joint_state(
        self,
        suffix: str,
        *,
        namespace: str | None = None,
        order: str = 'stamp',
        finite: Sequence[str] = QUANTITIES,
    ) -> JointStateSeries:
        """Return all messages of a JointState topic, found as by `find`, as arrays.

        Their `order` is ``'stamp'`` (of the header; equal ones as recorded) or ``'recorded'``;
        `finite` names what must not be NaN or infinite. MalformedMessageError where a message does
        not decode, BagError where the topic is none or several, or not a JointState.
        """
        if order not in ('stamp', 'recorded'):
            raise ValueError(f"order is 'stamp' or 'recorded', not {order!r}")
        topic = self._typed(suffix, namespace, JOINT_STATE)
        with _naming(self.path):
            series = decode_joint_states(topic, self.payloads(topic), *self.times(topic))
            if order == 'stamp':
                series = series.ordered(np.argsort(series.stamp_ns, kind='stable'))
            series.check_finite(finite)
        return series

    def poses(self, suffix: str, *, namespace: str | None = None) -> PoseSeries:
        """Return all messages of a PoseStamped topic as arrays, as recorded; errors as above."""
        topic = self._typed(suffix, namespace, POSE_STAMPED)
        with _naming(self.path):
            return decode_poses(topic, self.payloads(topic), *self.times(topic))

    def _typed(self, suffix: str, namespace: str | None, kind: str) -> str:
        topic = self.find(suffix, namespace)
        if self.topics[topic].type != kind:
            raise BagError(
                f'{self.path}: topic {topic} is {self.topics[topic].type or "untyped"}, not {kind}'
            )
        return topic

    def times(self, topic: str) -> MessageTimes:
        """Return receipt, publication and counter of the messages of a full topic name."""
        return self._stored.times(topic)

    def payloads(self, topic: str) -> Payloads:
        """Return the bytes of the messages of a full topic name, as recorded."""
        return self._stored.payloads([topic])[0]

    def header_stamps(self, topics: Sequence[str]) -> list[IntArray]:
        """Header stamps in ns, each (N,), of topics by full names; too short messages have none."""
        heads = [
            (block.topic[long], stamps_of_heads(block.data, block.start[long]))
            for block in self._stored.blocks(topics)
            for long in [block.size >= HEAD_WITH_STAMP]
        ]
        topic = np.concatenate([t for t, _ in heads] or [np.empty(0, np.int64)])
        stamp = np.concatenate([s for _, s in heads] or [np.empty(0, np.int64)])
        order = np.argsort(topic, kind='stable')
        bounds = np.searchsorted(topic[order], np.arange(1, len(topics)))
        return np.split(stamp[order], bounds)

    def messages(self, topics: Sequence[str] | None = None) -> Iterator[RawMessage]:
        """Yield messages by receipt time, of topics by their full names, or of all."""
        chosen = list(self.topics) if topics is None else list(topics)
        if not chosen:
            return
        times = [self.times(topic) for topic in chosen]
        payloads = self._stored.payloads(chosen)
        which = np.repeat(np.arange(len(chosen)), [len(t.log_ns) for t in times])
        row = np.concatenate([np.arange(len(t.log_ns)) for t in times])
        log_ns = np.concatenate([t.log_ns for t in times])
        for k in np.argsort(log_ns, kind='stable'):
            topic, index = int(which[k]), int(row[k])
            yield RawMessage(
                chosen[topic],
                int(log_ns[k]),
                int(times[topic].publish_ns[index]),
                int(times[topic].sequence[index]),
                payloads[topic][index],
            )

    def stored_messages(self) -> Iterator[RawMessage]:
        """Yield all messages as they are stored, chunk by chunk, which needs little memory."""
        topics = list(self.topics)
        for block in self._stored.blocks(topics):
            columns = (block.topic, block.log_ns, block.publish_ns, block.sequence)
            ends = block.start + block.size
            rows = zip(*(c.tolist() for c in (*columns, block.start, ends)), strict=True)
            for topic, log_ns, publish_ns, sequence, start, end in rows:
                data = block.data[start:end]
                yield RawMessage(topics[topic], log_ns, publish_ns, sequence, data)

    def decoded(self, topic: str) -> Iterator[tuple[RawMessage, Any]]:
        """Yield the messages of a full topic name, each with its object, of whatever type.

        UnknownTypeError if that is not one of Jazzy's common ones; MalformedMessageError where a
        message does not decode.
        """
        store, kind = typestore(), self.topics[topic].type
        if kind not in store.types:
            raise UnknownTypeError(
                f'{self.path}: topic {topic}: type {kind or "unnamed"} is unknown'
            )
        for number, message in enumerate(self.messages([topic]), start=1):
            try:
                yield message, store.deserialize_cdr(message.data, kind)
            except (SerdeError, ValueError, IndexError) as error:
                raise MalformedMessageError(
                    f'{self.path}: topic {topic}: message {number} does not decode: {error}'
                ) from error


def open_bag(path: str | Path, *, salvage: bool = False) -> Recording:
    """Open a rosbag2 folder with ``metadata.yaml`` and one or more ``.mcap``, or one such file.

    With `salvage` what is sound of a damaged recording is read (see `Recording.damage`) instead of
    raising a CorruptBagError. BagNotFoundError if it is not there; both are a BagError, as for what
    is no recording, holds no message or has a format that is not read.
    """
    path = Path(path)
    scans = [scan_mcap(file, salvage=salvage) for file in bag_files(path)]
    for scan in scans:
        foreign = {c.message_encoding for c in scan.channels.values()} - {'cdr'}
        if foreign:
            raise BagError(f'{scan.path}: message encoding {foreign.pop()!r} instead of cdr')
    recording = Recording(path, scans, salvage)
    if not recording.message_count:
        raise BagError(f'{path}: holds no message')
    return recording


def rig_record(rig: Rig) -> dict[str, dict[str, str]]:
    """The metadata record of a rig, for a `BagWriter`."""
    return {_NAME: {_KEY: rig_as_text(rig)}}


def copied_records(recording: Recording) -> dict[str, dict[str, str]]:
    """Records that stand before all messages, for another recording that is made of this one."""
    kept = (_NAME, EVENT_RECORD)
    return {name: content for name, content in recording.metadata.items() if name in kept}


def rig_of_bag(recording: Recording) -> Rig:
    """Return the rig that a recording carries; as shipped where it carries none."""
    text = recording.metadata.get(_NAME, {}).get(_KEY)
    return shipped_rig() if text is None else rig_from_text(text, f'the rig of {recording.path}')


def kind_of_bag(recording: Recording) -> RigKind:
    """Kind of a recording's rig: of several, as after a change of servos, real only if all are."""
    kinds = []
    for name, topic in recording.topics.items():
        if not f'/{name}'.endswith(f'/{RIG_KIND}') or topic.type != STRING:
            continue
        try:
            kinds += [kind_from_text(message.data) for _, message in recording.decoded(name)]
        except MalformedMessageError:
            kinds.append(RigKind())
    return kind_of_several(kinds)
