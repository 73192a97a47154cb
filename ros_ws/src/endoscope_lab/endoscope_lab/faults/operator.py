"""The operator of a running graph: enables it, moves the handle, and records the slave."""

import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.context import Context
from sensor_msgs.msg import JointState, Joy

from endoscope_core.exit_status import ClosedOnExit
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.names import (
    JOINTS,
    MASTER_CLUTCH,
    MASTER_MEASURED,
    MOTOR_COMMAND,
    MOTOR_MEASURED,
    MOTORS,
    SLAVE_COMMAND,
    SLAVE_MEASURED,
)
from endoscope_nodes.runtime.environment import stay_on_this_machine
from endoscope_nodes.runtime.qos import COMMAND, EVENT, SENSOR_OFFERED, profile
from endoscope_nodes.runtime.streams import JointPublisher, JointReader, JointSample
from endoscope_nodes.topics import Qos

_DEEP = profile(Qos(5000))
_TURN_NS = 4_000_000
_CLUTCH_TURNS = 25
_LET_GO_S = 1.0
# The hand swings at up to 1 rad/s, a shaft at half of that, and returns to the middle.
AMPLITUDE, RATE, STEERING = 0.5, 2.0, 0.5


class Operator(ClosedOnExit):
    """A handle of 250 Hz with its clutch, or an outside program that writes ``slave/servo_jp``.

    Messages are sent and received only in :meth:`serve`; samples are judged by their stamps.

    `domain`: ROS domain.
    `source`: ``master``, ``outside``, or ``none`` if the master plays a motion itself.
    `clutch`: whether the hand holds it.
    `shafts`, `goals`: samples of `motor/measured_js` and `motor/servo_jp`.
    `sent`: commands sent to `slave/servo_jp`: session, stamp in ns, positions and velocities.
    `replays`: whether each command is followed by a replay of an old one.
    `late_ns`: delay of the stamps.
    `graph`: client of the graph, for its state and for requests.
    """

    def __init__(self, domain: int) -> None:
        self.source = 'none'
        self.clutch = True
        self.shafts: list[JointSample] = []
        self.goals: list[JointSample] = []
        self.sent: deque[tuple[str, int, tuple[float, ...]]] = deque(maxlen=5000)
        self.replays = False
        self.late_ns = 0
        self._bending: JointSample | None = None
        self._turn = 0
        self._due_ns = 0
        self._to_stamp_ns = time.time_ns() - time.monotonic_ns()
        self._phase = 0.0
        self._hand: tuple[float, ...] = (0.0,) * len(JOINTS)
        self._entered = ''
        self._handle: JointPublisher | None = None
        self._clutch: Any = None
        self._context = Context()
        stay_on_this_machine()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self.node = rclpy.create_node('operator', context=self._context, namespace='endoscope')
        self.graph = GraphClient(self.node, self.serve)
        shafts, goals, joints = JointReader(MOTORS), JointReader(MOTORS), JointReader(JOINTS)
        for topic, take in (
            (MOTOR_MEASURED, lambda d, _: self.shafts.append(shafts.read(d))),
            (MOTOR_COMMAND, lambda d, _: self.goals.append(goals.read(d))),
            (SLAVE_MEASURED, lambda d, _: self._note_bending(joints.read(d))),
        ):
            self.graph.listen(JointState, topic, take, qos=_DEEP)

    def _note_bending(self, sample: JointSample) -> None:
        self._bending = sample

    def use(self, source: str) -> bool:
        """Become the publisher for a source, and of nothing else; whether the source is new."""
        if source == self.source:
            return False
        if self._handle is not None:
            self._handle.close()
            self.node.destroy_publisher(self._clutch)
        self.source = source
        self._handle = self._clutch = None
        if source == 'master':
            self._handle = JointPublisher(
                self.node, MASTER_MEASURED, JOINTS, ('position',), SENSOR_OFFERED
            )
        elif source == 'outside':
            self._handle = JointPublisher(
                self.node, SLAVE_COMMAND, JOINTS, ('position', 'velocity'), COMMAND
            )
        if source != 'none':
            self._clutch = self.node.create_publisher(Joy, MASTER_CLUTCH, EVENT)
        return True

    def press(self, held: bool) -> None:
        """Press or release the clutch, and publish that at once."""
        self.clutch = held
        if self._clutch is not None:
            self._clutch.publish(Joy(buttons=[int(held)]))

    def let_go_and_press(self) -> None:
        """Release and press the clutch: after a change of publisher it counts only from then on."""
        self.press(False)
        self.serve(_LET_GO_S)
        self.press(True)

    def serve(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Move and listen for some time, or until a condition holds; whether it does."""
        end = time.monotonic_ns() + round(seconds * 1e9)
        while True:
            now = time.monotonic_ns()
            if now >= self._due_ns:
                if now > self._due_ns + 2 * _TURN_NS:
                    self._due_ns = now
                # Stamps are one turn apart, however late this process is scheduled.
                self._send(self._due_ns + self._to_stamp_ns)
                self._due_ns += _TURN_NS
            self.graph.hear()
            if until():
                return True
            if now >= end:
                return False
            time.sleep(max(0, min(self._due_ns, end) - time.monotonic_ns()) * 1e-9)

    def _send(self, stamp_ns: int) -> None:
        self._turn += 1
        if self._clutch is not None and self._turn % _CLUTCH_TURNS == 0:
            self._clutch.publish(Joy(buttons=[int(self.clutch)]))
        if self._handle is None:
            return
        self._phase += RATE * _TURN_NS * 1e-9
        swing = AMPLITUDE * RATE * math.cos(self._phase)
        bent = self._bending.position if self._bending else (0.0,) * len(JOINTS)
        speed = tuple(swing - STEERING * x for x in bent)
        stamp = stamp_ns - self.late_ns
        if self.source == 'outside' and self.graph.session != self._entered:
            # A new session starts from the measured pose.
            self._entered, self._hand = self.graph.session, bent
        self._hand = tuple(a + v * _TURN_NS * 1e-9 for a, v in zip(self._hand, speed, strict=True))
        if self.source == 'master':
            self._handle.publish(stamp, *self._hand)
        elif self.graph.session:
            self.sent.append((self.graph.session, stamp, (*self._hand, *speed)))
            for session, stamped, values in (self.sent[-1], *self._old()):
                self._handle.session = session
                self._handle.publish(stamped, *values)

    def _old(self) -> list[tuple[str, int, tuple[float, ...]]]:
        return [self.sent[self._turn * 7919 % len(self.sent)]] if self.replays else []

    def close(self) -> None:
        self.graph.close()
        self.node.destroy_node()
        self._context.shutdown()
