"""The handle's thread: evaluates the dead-man and publishes the handle topics, at 250 Hz.

The deadline is checked here and not where the sockets are read: if those are held up, the clutch is
released instead of held.
"""

import threading
import time
from collections import deque
from dataclasses import dataclass, field
from typing import Self

from rclpy.node import Node

from endoscope_console.teleop.frames import InputFrame
from endoscope_console.teleop.operator import Conditions, DeadManState, OperatorDeadMan, Reason
from endoscope_console.teleop.pad import PadHandle
from endoscope_nodes.client.handle_sender import HandleSender

_BEAT_NS = 4_000_000
_IDLE_NS = 20_000_000
_WANTED_NS = 150_000_000
_UNTIL_STOPPED_S = 2.0


@dataclass(frozen=True)
class Situation(Conditions):
    """State of the graph and the lease, as last set by the other threads."""

    publishes: bool = False  # whether this server is the publisher of the handle topics
    wanted: tuple[float, ...] | None = None  # (J,), asked of the slave by the master, in rad
    wanted_ns: int = 0  # when they were heard
    scale: float = 1.0  # slave motion for one radian of the handle


@dataclass(frozen=True)
class BeatReport:
    """State of the dead-man at a beat; see :class:`OperatorDeadMan`."""

    state: DeadManState = DeadManState.OPEN
    reason: Reason | None = None
    missing: Reason | None = Reason.LOST
    counts: dict[str, int] = field(default_factory=dict)  # how often each reason has ended a grip
    publishes: bool = False  # whether the handle topics are published


class Beat:
    """The thread; it shares one-slot mailboxes and a queue of arrivals with the others."""

    def __init__(self, node: Node, handle: PadHandle) -> None:
        self.situation = Situation()  # replaced as a whole by other threads
        self.report = BeatReport()  # by the dead-man in the last beat in which it changed
        self._node = node
        self._handle = handle
        self._dead_man = OperatorDeadMan()
        self._sender: HandleSender | None = None
        self._arrivals: deque[tuple[str, InputFrame | Reason, int]] = deque()
        self._engaged_ns = 0
        self._asked = threading.Event()
        self._thread = threading.Thread(target=self._run, name='beat', daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Release the clutch and leave the handle's topics."""
        self._asked.set()
        self._thread.join(_UNTIL_STOPPED_S)

    @property
    def alive(self) -> bool:
        """Whether the thread runs; nothing moves otherwise."""
        return self._thread.is_alive()

    @property
    def grips(self) -> int:
        """Greatest number of a grip so far."""
        return self._dead_man.grips

    def hear(self, client: str, frame: InputFrame, arrived_ns: int) -> None:
        """Take a frame of a client that arrived at a steady time in ns."""
        self._arrivals.append((client, frame, arrived_ns))

    def refuse(self, client: str, reason: Reason, now_ns: int) -> None:
        """Take an invalid frame of a client, or its disconnection, at a steady time in ns."""
        self._arrivals.append((client, reason, now_ns))

    def _run(self) -> None:
        due_ns = time.monotonic_ns()
        try:
            while not self._asked.is_set():
                now_ns = time.monotonic_ns()
                self._turn(now_ns)
                period_ns = _BEAT_NS if self.situation.holder or self._sender else _IDLE_NS
                due_ns = max(due_ns + period_ns, now_ns)
                time.sleep(max(0, due_ns - time.monotonic_ns()) * 1e-9)
        finally:
            self._leave()

    def _turn(self, now_ns: int) -> None:
        dead_man = self._dead_man
        while self._arrivals:
            client, what, arrived_ns = self._arrivals.popleft()
            if isinstance(what, InputFrame):
                dead_man.hear(what, arrived_ns, client)
            elif what is Reason.CLOSED:
                dead_man.closed(client)
            else:
                dead_man.refuse(what, client)
        # Read only now: a frame may name a picture that was made after the last reading.
        situation = self.situation
        dead_man.turn(now_ns, situation)
        self._publish(now_ns, situation)
        self._report()

    def _publish(self, now_ns: int, situation: Situation) -> None:
        """Publish the handle's angles and clutch, while this server is the publisher."""
        if self._sender is None and situation.publishes:
            self._sender = HandleSender(self._node)
        elif self._sender is not None and not situation.publishes:
            self._leave()
        engaged = self._dead_man.engaged
        if self._sender is None:
            return
        wall_ns = time.time_ns()
        if self._sender.clutch and not engaged:
            self._sender.press(False, wall_ns)
        if not engaged:
            self._engaged_ns = 0
        fresh = situation.wanted_ns > max(self._engaged_ns, now_ns - _WANTED_NS)
        position = self._handle.follow(
            now_ns,
            # The hand that lets a motion play does not move the handle.
            self._dead_man.frame if engaged and not situation.playing else None,
            situation.wanted if fresh else None,
            situation.scale,
        )
        if engaged and not self._engaged_ns:
            # The handle stands still in this beat; the clutch follows in the next one.
            self._engaged_ns = now_ns
        elif engaged and not self._sender.clutch:
            self._sender.press(True, wall_ns)
        self._sender.send(wall_ns, position)

    def _leave(self) -> None:
        if self._sender is not None:
            self._sender.press(False, time.time_ns())
            self._sender.close()
            self._sender = None

    def _report(self) -> None:
        dead_man, last = self._dead_man, self.report
        now = (dead_man.state, dead_man.reason, dead_man.missing, self._sender is not None)
        if now == (last.state, last.reason, last.missing, last.publishes):
            return
        self.report = BeatReport(
            dead_man.state,
            dead_man.reason,
            dead_man.missing,
            {str(reason): count for reason, count in dead_man.counts.items()},
            self._sender is not None,
        )
