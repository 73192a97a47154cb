"""What becomes of messages as they arrive: recorded, kept for a while, put into bags of events."""

import itertools
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

from endoscope_bags.errors import BagError
from endoscope_bags.event_bag import EventKeeping, held_since
from endoscope_bags.recent_messages import RecentMessages
from endoscope_bags.recording_session import Arrival, RecordingSession, SessionReport
from endoscope_bags.topic import QosProfile
from endoscope_core.atomic_output import with_final_names
from endoscope_core.rig import Rig


class Recorder:
    """Recordings from `start` to `stop`, and bags of events; each begins with what is in force.

    `path` is where the next recording goes, empty for a new name; bags of events go beside it. For
    `collect` and `notify` see :class:`EventKeeping`.
    """

    def __init__(
        self,
        rig: Rig,
        recent: RecentMessages,
        path: str,
        most: int,
        collect: Callable[[], None],
        notify: Callable[[str, bool], None],
    ) -> None:
        self.path, self.recent = path, recent
        self.session: RecordingSession | None = None
        self.last_report: SessionReport | None = None  # none before the first has ended
        self.events = EventKeeping(recent, most, self._folder, self._new_session, collect, notify)
        self._rig, self._collect = rig, collect
        self._topics: list[tuple[str, str, Callable[[], Sequence[QosProfile]], Callable[[], int]]]
        self._topics = []
        self._reported_loss = 0

    def add_topic(
        self,
        topic: str,
        type_name: str,
        offered_qos: Callable[[], Sequence[QosProfile]],
        count_publishers: Callable[[], int],
    ) -> int:
        """Announce a topic and return its number; see :meth:`RecordingSession.add_topic`."""
        self._topics.append((topic, type_name, offered_qos, count_publishers))
        for session in (self.session, *(event.session for event in self.events.events)):
            if session is not None:
                session.add_topic(*self._topics[-1])
        return len(self._topics) - 1

    def _new_session(
        self, path: Path, records: Mapping[str, dict[str, str]] | None = None
    ) -> RecordingSession:
        session = RecordingSession(path, rig=self._rig, records=records)
        for topic in self._topics:
            session.add_topic(*topic)
        return session

    def _folder(self) -> Path:
        return Path(self.path or new_bag()).parent

    def start(self, now_ns: int, remedy: str) -> Path:
        """Begin a recording, and say where; BagError, with the `remedy`, if one is under way."""
        if self.session is not None:
            there = with_final_names(str(self.session.path))
            raise BagError(f'already recording to {there}: `{remedy}` ends that')
        path = Path(self.path or new_bag())
        # What came before is no part of it, but what is in force.
        self._collect()
        self.session = self._new_session(path)
        self.session.accept(held_since(self.recent.in_force, now_ns))
        self._reported_loss = 0
        return path

    def stop(self) -> SessionReport:
        """End the recording and say how it went; BagError if there is none."""
        if self.session is None:
            raise BagError('not recording')
        self._collect()
        session, self.session = self.session, None
        self.last_report = session.close('on request')
        return self.last_report

    def take(
        self,
        arrivals: list[Arrival],
        holding: Collection[int],
        now_ns: int,
        steady_ns: int,
        stale: bool,
    ) -> None:
        """Take what arrived by `now_ns`; `stale` hands over chunks that nothing has closed."""
        self.recent.add(arrivals, holding, now_ns)
        if self.session is not None:
            if arrivals:
                self.session.accept(arrivals)
            if stale:
                self.session.flush_stale(now_ns)
        self.events.go_on(arrivals, steady_ns)

    def new_losses(self) -> str:
        """How the recording goes, where more has been lost than when this was last asked."""
        report = None if self.session is None else self.session.report()
        if report is None or report.lost_count <= self._reported_loss:
            return ''
        self._reported_loss = report.lost_count
        return str(report)


def new_bag() -> str:
    """Return where a recording goes that has no name; several of one second are numbered."""
    first = time.strftime('bags/recording-%Y%m%d-%H%M%S')
    numbered = (f'{first}-{n}' for n in itertools.count(2))
    return next(name for name in itertools.chain([first], numbered) if not Path(name).exists())
