"""`endoscope bench stick`: how late a velocity of another program reaches the motors."""

import argparse
import math
import multiprocessing
import os
import tempfile
import time
from collections.abc import Sequence
from itertools import pairwise

from rclpy.executors import SingleThreadedExecutor
from rclpy.time import Time
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Header

from endoscope_core.errors import EndoscopeError
from endoscope_lab.bench import spread
from endoscope_lab.graph import Composition
from endoscope_nodes.graph import ALL_NODES
from endoscope_nodes.names import (
    JOINTS,
    MASTER_CLUTCH,
    MOTION_SESSION,
    MOTOR_COMMAND,
    MOTORS,
    SLAVE_COMMAND,
    SLAVE_VELOCITY,
)
from endoscope_nodes.runtime.environment import joined_node
from endoscope_nodes.runtime.private_domain import process_domain
from endoscope_nodes.runtime.qos import COMMAND, EVENT, SENSOR_OFFERED
from endoscope_nodes.runtime.streams import JointSample, JointSubscription
from endoscope_nodes.runtime.ticker import TICK_NS

TARGET_P99_MS = 3.0
_SPEED = 0.3
_PERIOD_S = 0.01
_MESSAGES_A_WAY = 20
_LATEST_TICK_NS = 50_000_000
_SETTLING_S, _PATIENCE_S = 2.0, 60.0


def run(args: argparse.Namespace) -> int:
    """Print the figures; return 1 if the target is missed."""
    context = multiprocessing.get_context('spawn')
    stick = context.Process(target=_hold_stick, args=(process_domain(),), daemon=True)
    with (
        tempfile.TemporaryDirectory() as folder,
        Composition(ALL_NODES, {'recorder': {'bag': f'{folder}/bag'}}) as graph,
    ):
        heard = _Heard(graph)
        stick.start()
        try:
            deadline = time.monotonic() + _PATIENCE_S
            while not heard.positions:
                if time.monotonic() > deadline:
                    raise EndoscopeError(f'no velocity is obeyed: {graph.situation}')
                graph.enable()
                graph.serve(_SETTLING_S)
            graph.enable()
            heard.clear()
            graph.serve(args.seconds)
            situation = graph.situation
        finally:
            stick.terminate()
            stick.join()
    late = heard.latencies()
    if not late:
        raise EndoscopeError(f'no change of velocity reached the motors: {situation}')
    middle, p99, most = spread(late)
    print(
        f'velocity of another process to motor: {middle:.2f} ms (p99 {p99:.2f}, at most '
        f'{most:.2f}) in {len(late)} reversals of {args.seconds:.0f} s, {situation} at the end, '
        f'load average {os.getloadavg()[0]:.1f}',
        flush=True,
    )
    return 0 if p99 < TARGET_P99_MS else 1


class _Heard:
    """What was commanded, and when the motors' driver was given what came of it."""

    def __init__(self, graph: Composition) -> None:
        node, self._ticker = graph.node('motor_driver'), graph.runtime.ticker
        self.velocities: list[JointSample] = []
        self.positions: list[JointSample] = []
        self.commands: dict[int, int] = {}
        JointSubscription(node, SLAVE_VELOCITY, JOINTS, self.velocities.append, SENSOR_OFFERED)
        JointSubscription(node, SLAVE_COMMAND, JOINTS, self.positions.append, SENSOR_OFFERED)
        JointSubscription(node, MOTOR_COMMAND, MOTORS, self._note, SENSOR_OFFERED)

    def _note(self, sample: JointSample) -> None:
        self.commands[sample.stamp_ns] = self._ticker.monotonic_ns()

    def clear(self) -> None:
        for each in (self.velocities, self.positions, self.commands):
            each.clear()

    def latencies(self) -> list[float]:
        """From each reversal of the stick to the driver's tick that obeys it, in ms."""
        obeyed, late = list(_turns(self.positions)), []
        for stamp_ns in _reversals(self.velocities):
            # A tick that comes late is stamped with the time at which it was due.
            first = next((ns for ns in obeyed if ns >= stamp_ns - _LATEST_TICK_NS), None)
            if first not in self.commands:
                continue
            # The driver takes what has come at its next tick.
            due_ns = self._ticker.monotonic_of(first)
            ticks = math.ceil((self.commands[first] - due_ns) / TICK_NS)
            late.append((due_ns + ticks * TICK_NS - self._ticker.monotonic_of(stamp_ns)) * 1e-6)
        return late


def _reversals(velocities: Sequence[JointSample]) -> list[int]:
    return [b.stamp_ns for a, b in pairwise(velocities) if a.velocity[0] * b.velocity[0] < 0.0]


def _turns(positions: Sequence[JointSample]) -> list[int]:
    """Stamps at which a steady motion begins to be braked."""
    steady = 0.999 * _SPEED
    return [
        b.stamp_ns
        for a, b in pairwise(positions)
        if abs(a.velocity[0]) > steady > abs(b.velocity[0])
    ]


def _hold_stick(domain: int) -> None:
    """Command a velocity that reverses, with the clutch held, until this is ended."""
    with joined_node('stick', 'endoscope', domain) as node:
        session = ['']

        def enter(message: Header) -> None:
            session[0] = message.frame_id

        node.create_subscription(Header, MOTION_SESSION, enter, EVENT)
        rates = node.create_publisher(JointState, SLAVE_VELOCITY, COMMAND)
        clutch = node.create_publisher(Joy, MASTER_CLUTCH, EVENT)
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)
        due, sent = time.monotonic(), 0
        while node.context.ok():
            executor.spin_once(timeout_sec=0.0)
            # Unlike the ticks of the graph, so that reversals come at any time between them.
            due = max(due + _PERIOD_S + 1e-4 * (sent % 11), time.monotonic() - _PERIOD_S)
            time.sleep(max(0.0, due - time.monotonic()))
            speed = _SPEED if sent // _MESSAGES_A_WAY % 2 else -_SPEED
            message = JointState(name=list(JOINTS), velocity=[speed, 0.0])
            message.header.frame_id = session[0]
            clutch.publish(Joy(buttons=[1]))
            message.header.stamp = Time(nanoseconds=time.time_ns()).to_msg()
            rates.publish(message)
            sent += 1
