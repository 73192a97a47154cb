"""`endoscope bench graph`: whether the node graph keeps its rate, in one process and in many."""

import argparse
import faulthandler
import multiprocessing
import os
import tempfile
import time
from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.qos import qos_profile_sensor_data
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from endoscope_core.errors import EndoscopeError
from endoscope_core.exit_status import ClosedOnExit
from endoscope_core.safety import OperatingState
from endoscope_lab import recorder
from endoscope_lab.bench import cpu_seconds, spread
from endoscope_lab.faults.node_processes import NODES, NodeProcesses
from endoscope_lab.faults.operator import Operator
from endoscope_nodes.graph import ALL_NODES
from endoscope_nodes.names import (
    CLOCK_NODE,
    MOTOR_MEASURED,
    STATE_COMMAND,
    WIRES_MEASURED,
)
from endoscope_nodes.nodes.simulation_clock import SimulationClockNode
from endoscope_nodes.runtime.environment import joined_node
from endoscope_nodes.runtime.private_domain import private_domain, process_domain
from endoscope_nodes.runtime.qos import EVENT, RESULT
from endoscope_nodes.runtime.runtime import Runtime

PROCESS_RATES = (1000, 500, 250, 125)


def run(args: argparse.Namespace) -> int:
    """Print the figures; return 1 if a target is missed."""
    if args.recorder:
        return recorder.run(args.seconds)
    if args.soak:
        return 0 if outlives_visitors(args.soak) else 1
    reached = composed_graph_is_carried(args.seconds)
    speed = lock_step_speed(min(args.seconds, 20.0))
    print(f'lock-step: {speed:.1f} times real time', flush=True)
    if args.process_seconds:
        any(processes_are_carried(rate, args.process_seconds) for rate in PROCESS_RATES)
    return 0 if reached and speed >= TARGET_LOCK_STEP else 1


TARGET_TICKS = 0.99
TARGET_LATENCY_P99_MS = 1.0
TARGET_CORES = 1.0
TARGET_LOCK_STEP = 2.0
_SETTLING_S = 2.0
# Before the queue of a thousand commands is full.
_MOVING_S = 0.5
SIMULATED = ('--ros-args', '-p', 'use_sim_time:=true')
_VISIT_S = 0.1
_PLAYING = {'source': 'motion', 'motion': 'periodic'}


def composed_graph_is_carried(seconds: float) -> bool:
    """Measure all nodes, recorder included, in this process in real time, once settled."""
    with _recorded() as overrides, Composition(ALL_NODES, overrides) as graph:
        graph.enable()
        graph.serve(_SETTLING_S)
        pace = graph.kept_pace(seconds)
        state = graph.situation
        report = graph.node('recorder').stop()
    print(
        f'one process, 1 kHz, {pace.elapsed:.0f} s: {pace}, {report.message_count} messages '
        f'recorded, {report.lost_count} lost, {state} at the end, load average '
        f'{os.getloadavg()[0]:.1f}',
        flush=True,
    )
    kept = (
        pace.share >= TARGET_TICKS
        and pace.late < TARGET_LATENCY_P99_MS
        and pace.cores < TARGET_CORES
    )
    return kept and report.lost_count == 0 and state == OperatingState.ENABLED


def outlives_visitors(seconds: float) -> bool:
    """Let participants join and leave for some time while all nodes run here at 1 kHz.

    A graph that hangs prints the stacks of its threads, and ends the process.
    """
    context = multiprocessing.get_context('spawn')
    visits = context.Value('i')
    with _recorded() as overrides, Composition(ALL_NODES, overrides) as graph:
        visitor = context.Process(target=_visit, args=(process_domain(), visits), daemon=True)
        visitor.start()
        try:
            ticks = graph.runtime.ticker.ticks
            end = time.monotonic() + seconds
            while (left := end - time.monotonic()) > 0.0:
                faulthandler.dump_traceback_later(graph.STUCK_S, exit=True)
                # Again, since a busy machine ends the motion.
                graph.enable()
                graph.serve(min(left, _SETTLING_S))
            ticks = graph.runtime.ticker.ticks - ticks
            state = graph.situation
        finally:
            faulthandler.cancel_dump_traceback_later()
            visitor.terminate()
            visitor.join()
    print(
        f'{seconds:.0f} s at 1 kHz while {visits.value} participants joined and left: {ticks} '
        f'ticks, {state} at the end',
        flush=True,
    )
    return ticks > 0 and visits.value > 0


def _visit(domain: int, visits: Synchronized) -> None:
    """Join and leave in an endless loop, with topics whose QoS does not match the graph's."""
    while True:
        with joined_node('visitor', 'endoscope', domain) as node:
            node.create_publisher(String, STATE_COMMAND, qos_profile_sensor_data)
            for topic, qos in ((MOTOR_MEASURED, RESULT), (WIRES_MEASURED, EVENT)):
                node.create_subscription(JointState, topic, print, qos)
            time.sleep(_VISIT_S)
        visits.value += 1


def lock_step_speed(seconds: float) -> float:
    """Simulated seconds per real second of the whole graph in lock-step, recorder included."""
    with _recorded() as overrides, _in_lock_step(overrides, 0.5) as graph:
        began = time.monotonic()
        graph.advance(seconds)
        return seconds / (time.monotonic() - began)


def least_cores(
    overrides: Mapping[str, Mapping[str, object]], settling_s: float, seconds: float
) -> float:
    """Least CPU time of all nodes in one process for one second of motion, once settled.

    Lock-step gives the same ticks with the same messages, however busy the machine is.
    """
    with _in_lock_step(overrides, settling_s) as graph:
        costs = []
        for _ in range(round(seconds)):
            cpu = time.process_time()
            graph.advance(1.0)
            costs.append(time.process_time() - cpu)
    # Other load only adds time, through the caches.
    return min(costs)


@contextmanager
def _recorded() -> Iterator[Mapping[str, Mapping[str, object]]]:
    """Parameters of a graph that moves and is recorded to a temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        yield {'recorder': {'bag': f'{folder}/bag'}, 'master': _PLAYING}


@contextmanager
def _in_lock_step(
    overrides: Mapping[str, Mapping[str, object]], settling_s: float
) -> Iterator['Composition']:
    """All nodes in simulated time, enabled and settled."""
    with Composition((*ALL_NODES, SimulationClockNode), overrides, SIMULATED) as graph:
        graph.advance(0.5)
        graph.enable()
        graph.advance(settling_s)
        yield graph


@dataclass(frozen=True)
class Pace:
    """Rate and latency of a graph in real time."""

    elapsed: float  # s
    share: float  # of the ticks that were due
    # Latency in ms from the due time of the master's tick to its execution by the motor driver:
    # median and 99th percentile.
    middle: float
    late: float
    cores: float

    def __str__(self) -> str:
        return (
            f'{100 * self.share:.2f} % of ticks, command to motor {self.middle:.2f} ms '
            f'(p99 {self.late:.2f}), {self.cores:.2f} cores'
        )


class Composition(ClosedOnExit):
    """Nodes in this process with a context and a domain of their own."""

    _WAITING_S = 60.0
    STUCK_S = 120.0

    def __init__(
        self,
        factories: Sequence[Any],
        overrides: Mapping[str, Mapping[str, object]],
        args: Sequence[str] = (),
    ) -> None:
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.runtime = Runtime(args, Context(), process_domain(), overrides)
        for factory in factories:
            self.runtime.add(factory)
        self.runtime.prepare()
        self._first = self.runtime.nodes[0]
        self._commands = self._first.create_publisher(String, STATE_COMMAND, EVENT)
        deadline = time.monotonic() + self._WAITING_S
        while not self.runtime.connected():
            if time.monotonic() > deadline:
                raise RuntimeError('the nodes do not find each other')
            time.sleep(0.01)

    def node(self, name: str) -> Any:
        return next(n for n in self.runtime.nodes if n.get_name() == name)

    @property
    def situation(self) -> str:
        """Operating state, and the cause of a fault."""
        machine = self.node('supervisor').machine
        return f'{machine.state} {machine.cause}'.strip()

    def enable(self) -> None:
        machine = self.node('supervisor').machine
        deadline = time.monotonic() + self._WAITING_S
        while machine.state is not OperatingState.ENABLED:
            if time.monotonic() > deadline:
                raise RuntimeError(f'the slave is not enabled: {machine.present_causes}')
            self.serve(0.1)
            self._commands.publish(String(data='enable'))
            self.serve(0.1)

    def serve(self, seconds: float) -> None:
        future = Future()
        timer = self._first.create_timer(
            seconds, lambda: future.done() or future.set_result(None), clock=self._steady
        )
        self.runtime.spin_until(future, seconds + self._WAITING_S)
        self._first.destroy_timer(timer)

    def kept_pace(self, seconds: float) -> Pace:
        """Run in real time for some seconds, and measure the pace."""
        ticker, latency = self.runtime.ticker, self._kept(self.node('motor_driver').latency_ns)
        ticks, missed, cpu = ticker.ticks, ticker.missed, time.process_time()
        began = time.monotonic()
        self.serve(seconds)
        elapsed, cpu = time.monotonic() - began, time.process_time() - cpu
        ticks, missed = ticker.ticks - ticks, ticker.missed - missed
        if not latency:
            raise EndoscopeError(
                f'no command reached the motors: {self.situation}; give the graph an idle machine'
            )
        middle, late, _ = (1e-6 * each for each in spread(latency))
        return Pace(elapsed, ticks / (ticks + missed), middle, late, cpu / elapsed)

    def _kept(self, newest: deque[int]) -> list[int]:
        """Collect from now on all values of a queue that a node keeps short."""
        values: list[int] = []
        newest.clear()

        def move() -> None:
            values.extend(newest)
            newest.clear()

        self._first.create_timer(_MOVING_S, move, clock=self._steady)
        return values

    def advance(self, seconds: float) -> None:
        future = self.node(CLOCK_NODE).advance(seconds)
        self.runtime.spin_until(future, 10.0 * seconds + self._WAITING_S)

    def close(self) -> None:
        self.runtime.close()


CARRIED = 0.99
_OBEYING = ('compensator', 'motor_driver')
_ENABLING_S = 120.0


def processes_are_carried(rate: int, seconds: float) -> bool:
    """Measure the graph with a process for each node, at a tick rate that divides 1000."""
    domain = private_domain()
    with (
        tempfile.TemporaryDirectory() as folder,
        NodeProcesses(domain, Path(folder)) as processes,
        Operator(domain) as operator,
    ):
        of_node: dict[str, dict[str, object]] = {
            'master': {'source': 'motion'},
            'recorder': {'bag': f'{folder}/bag'},
        }
        for node in NODES:
            processes.start(node, {node: of_node.get(node, {}) | {'tick_rate': rate}})
        _enable(operator)
        operator.serve(_SETTLING_S)
        before = _counts(operator)
        cpu = sum(map(cpu_seconds, processes.pids))
        began = time.monotonic()
        operator.serve(seconds)
        after, elapsed = _counts(operator), time.monotonic() - began
        state = operator.graph.state
        cpu = sum(map(cpu_seconds, processes.pids)) - cpu
    done = after - before
    due = done['ticks'] + done['missed ticks']
    ticks, commands = done['ticks'] / due, done['motor_driver accepted'] / due
    carried = ticks >= CARRIED and commands >= CARRIED
    print(
        f'{len(NODES)} processes at {rate} Hz: {100 * ticks:.1f} % of ticks, '
        f'{100 * commands:.1f} % of commands obeyed, {cpu / elapsed:.2f} cores, load average '
        f'{os.getloadavg()[0]:.1f}' + ('' if carried else f': not carried, {state}, {_hops(done)}'),
        flush=True,
    )
    return carried


def _hops(done: Counter[str]) -> str:
    # Commands missing beyond the refused ones were replaced by newer ones before they were read.
    text = f'the master sent {done["sent"]}'
    for node in _OBEYING:
        refused = [f'{n} {key}' for key, n in done.items() if key.startswith(f'{node} refused')]
        text += ', '.join([f', {node} obeyed {done[f"{node} accepted"]}', *refused])
    return text


def _enable(operator: Operator) -> None:
    """Wait until every node publishes and the slave follows commands."""
    deadline = time.monotonic() + _ENABLING_S
    while operator.graph.state != OperatingState.ENABLED or len(operator.graph.heard_ns) < len(
        NODES
    ):
        if time.monotonic() > deadline:
            silent = sorted(set(NODES) - set(operator.graph.heard_ns))
            raise RuntimeError(f'{operator.graph.state or "no state"}; silent: {", ".join(silent)}')
        operator.graph.order('enable')
        operator.serve(1.0)


def _counts(operator: Operator) -> Counter[str]:
    """Ticks of the motor driver, and the commands each node sent, obeyed and refused."""
    operator.serve(1.1)
    device = operator.graph.health['motor_driver: device'].values
    found = Counter({key: int(device[key]) for key in ('ticks', 'missed ticks')})
    found['sent'] = int(operator.graph.health['master: commands'].values['published'])
    for node in _OBEYING:
        for key, value in operator.graph.health[f'{node}: commands'].values.items():
            if key.startswith(('accepted', 'refused')):
                found[f'{node} {key}'] = int(value)
    return found
