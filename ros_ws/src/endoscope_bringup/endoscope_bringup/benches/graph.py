"""`endoscope bench graph`: whether the node graph keeps its pace, in one process and in many."""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TARGET_TICKS = 0.99
TARGET_LATENCY_P99_MS = 1.0
TARGET_CORES = 1.0
TARGET_LOCK_STEP = 2.0
PROCESS_RATES = (1000, 500, 250, 125)
NODES = (
    'motor_driver',
    'load_cells',
    'em_tracker',
    'supervisor',
    'compensator',
    'controller',
    'calibration',
    'console',
    'recorder',
)
_SETTLING_S = 2.0


@dataclass(frozen=True)
class ComposedFigure:
    """All nodes in one process.

    Attributes
    ----------
    seconds
        Length of the measurement.
    ticks
        Share of the 1 kHz ticks that took place.
    latency_p50_ms, latency_p99_ms
        From the instant at which the console's tick was due to the motor driver's obeying it.
    cores
        CPU time of the process per second.
    recorded, lost
        Messages in the bag, and messages that publishers sent and the recorder did not get.
    load
        Load average of the machine at the end.
    """

    seconds: float
    ticks: float
    latency_p50_ms: float
    latency_p99_ms: float
    cores: float
    recorded: int
    lost: int
    load: float

    @property
    def reached(self) -> bool:
        """Whether every target is met."""
        return (
            self.ticks >= TARGET_TICKS
            and self.latency_p99_ms < TARGET_LATENCY_P99_MS
            and self.cores < TARGET_CORES
            and self.lost == 0
        )

    def __str__(self) -> str:
        return (
            f'one process, 1 kHz, {self.seconds:.0f} s: {100 * self.ticks:.2f} % of ticks, '
            f'command to motor {self.latency_p50_ms:.2f} ms (p99 {self.latency_p99_ms:.2f}), '
            f'{self.cores:.2f} cores, {self.recorded} messages recorded, {self.lost} lost, '
            f'load average {self.load:.1f}'
        )


@dataclass(frozen=True)
class ProcessesFigure:
    """Each node a process of its own.

    Attributes
    ----------
    rate
        Beats per second that were asked for.
    ticks
        Share of them that the motor driver made.
    commands
        Commands that it obeyed, as a share of those beats.
    cores
        CPU time of all processes per second.
    """

    rate: int
    ticks: float
    commands: float
    cores: float

    @property
    def carried(self) -> bool:
        """Whether this rate is kept up with."""
        return self.ticks >= TARGET_TICKS and self.commands >= TARGET_TICKS

    def __str__(self) -> str:
        return (
            f'{len(NODES)} processes at {self.rate} Hz: {100 * self.ticks:.1f} % of ticks, '
            f'{100 * self.commands:.1f} % of commands obeyed, {self.cores:.2f} cores'
            + ('' if self.carried else ', not carried')
        )


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `graph`."""
    parser = subparsers.add_parser(
        'graph',
        help='ticks, latency and CPU time of the node graph',
        description='Runs all nodes on the simulated slave: in one process in real time, with a '
        'recorder; in lock-step as fast as it goes; and each in a process of its own at several '
        'rates. Exits 1 where a target is missed.',
    )
    parser.add_argument(
        '--seconds',
        type=float,
        default=60.0,
        help='length of the run in one process (default: %(default)g)',
    )
    parser.add_argument(
        '--process-seconds',
        type=float,
        default=10.0,
        help='length of each run in many processes, 0 for none (default: %(default)g)',
    )


def run(args: argparse.Namespace) -> int:
    """Print the figures; return 1 if a target is missed."""
    composed = run_graph_bench(args.seconds)
    print(composed, flush=True)
    speed = run_lock_step_bench(min(args.seconds, 20.0))
    print(f'lock-step: {speed:.1f} times real time', flush=True)
    if args.process_seconds:
        for rate in PROCESS_RATES:
            figure = run_processes_bench(rate, args.process_seconds)
            print(figure, flush=True)
            if figure.carried:
                break
    return 0 if composed.reached and speed >= TARGET_LOCK_STEP else 1


def run_graph_bench(seconds: float) -> ComposedFigure:
    """Measure all nodes, recorder included, composed in this process in real time.

    Parameters
    ----------
    seconds
        Length of the measurement, after some seconds of settling.
    """
    from endoscope_nodes.graph import ALL_NODES

    with tempfile.TemporaryDirectory() as folder:
        bench = _Composition(
            ALL_NODES,
            {
                'recorder': {'bag': str(Path(folder) / 'bag')},
                'console': {'source': 'motion', 'motion': 'periodic'},
            },
        )
        try:
            bench.enable()
            bench.serve(_SETTLING_S)
            driver, ticker = bench.node('motor_driver'), bench.runtime.ticker
            driver.latency_ns = deque()
            ticks, missed, cpu, began = (
                ticker.ticks,
                ticker.missed,
                time.process_time(),
                time.monotonic(),
            )
            bench.serve(seconds)
            cpu, elapsed = time.process_time() - cpu, time.monotonic() - began
            ticks, missed = ticker.ticks - ticks, ticker.missed - missed
            latency = sorted(driver.latency_ns)
            report = bench.node('recorder').stop()
        finally:
            bench.close()
    return ComposedFigure(
        elapsed,
        ticks / (ticks + missed),
        latency[len(latency) // 2] * 1e-6,
        latency[len(latency) * 99 // 100] * 1e-6,
        cpu / elapsed,
        report.message_count,
        report.lost_count,
        os.getloadavg()[0],
    )


def run_lock_step_bench(seconds: float) -> float:
    """Simulated seconds per real second of the whole graph in lock-step, recorder included."""
    from endoscope_nodes.conductor_node import ConductorNode
    from endoscope_nodes.graph import ALL_NODES

    with tempfile.TemporaryDirectory() as folder:
        bench = _Composition(
            (*ALL_NODES, ConductorNode),
            {'recorder': {'bag': str(Path(folder) / 'bag')}, 'console': {'source': 'motion'}},
            ['--ros-args', '-p', 'use_sim_time:=true'],
        )
        try:
            conductor = bench.node('conductor')
            bench.runtime.spin_until(conductor.advance(0.5), 60.0)
            bench.enable()
            bench.runtime.spin_until(conductor.advance(0.5), 60.0)
            began = time.monotonic()
            bench.runtime.spin_until(conductor.advance(seconds), 60.0 + 10.0 * seconds)
            return seconds / (time.monotonic() - began)
        finally:
            bench.close()


class _Composition:
    """Nodes in this process with a context and a domain of their own."""

    def __init__(self, factories: tuple, overrides: dict, args: list[str] | None = None) -> None:
        from rclpy.clock import Clock, ClockType
        from rclpy.context import Context
        from rclpy.task import Future
        from std_msgs.msg import String

        from endoscope_nodes.names import STATE_COMMAND
        from endoscope_nodes.qos import EVENT
        from endoscope_nodes.runtime import Runtime

        self._future, self._string = Future, String
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.runtime = Runtime(args or [], Context(), 100 + os.getpid() % 130, overrides)
        for factory in factories:
            self.runtime.add(factory)
        self._first = self.runtime.nodes[0]
        self._commands = self._first.create_publisher(String, STATE_COMMAND, EVENT)
        deadline = time.monotonic() + 30.0
        while not self.runtime.connected():
            if time.monotonic() > deadline:
                raise RuntimeError('the nodes do not find each other')
            time.sleep(0.01)

    def node(self, name: str) -> Any:
        return next(n for n in self.runtime.nodes if n.get_name() == name)

    def enable(self) -> None:
        from endoscope_core.safety import OperatingState

        machine = self.node('supervisor').machine
        for _ in range(50):
            self.serve(0.1)
            self._commands.publish(self._string(data='enable'))
            self.serve(0.1)
            if machine.state is OperatingState.ENABLED:
                return
        raise RuntimeError(f'the slave is not enabled: {machine.present_causes}')

    def serve(self, seconds: float) -> None:
        future = self._future()
        timer = self._first.create_timer(
            seconds, lambda: future.done() or future.set_result(None), clock=self._steady
        )
        self.runtime.spin_until(future, seconds + 60.0)
        self._first.destroy_timer(timer)

    def close(self) -> None:
        self.runtime.close()


def run_processes_bench(rate: int, seconds: float) -> ProcessesFigure:
    """Measure the graph with each node in a process of its own.

    Parameters
    ----------
    rate
        Beats per second; a divisor of 1000.
    seconds
        Length of the measurement.

    Raises
    ------
    RuntimeError
        A node does not start, or the slave cannot be enabled.
    """
    domain = 100 + (os.getpid() + rate) % 130
    environment = os.environ | {'ROS_DOMAIN_ID': str(domain)}
    with tempfile.TemporaryDirectory() as folder, _Watcher(domain) as watcher:
        processes = [
            subprocess.Popen(
                _command(node, rate, folder),
                env=environment,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            for node in NODES
        ]
        try:
            watcher.enable()
            time.sleep(_SETTLING_S)
            before, cpu = watcher.counts(), sum(_cpu_seconds(p.pid) for p in processes)
            began = time.monotonic()
            watcher.serve(seconds)
            after, elapsed = watcher.counts(), time.monotonic() - began
            cpu = sum(_cpu_seconds(p.pid) for p in processes) - cpu
        finally:
            for process in processes:
                process.terminate()
            for process in processes:
                process.wait(timeout=30)
    ticks, missed, obeyed = (b - a for a, b in zip(before, after, strict=True))
    due = ticks + missed
    return ProcessesFigure(rate, ticks / due, obeyed / due, cpu / elapsed)


def _command(node: str, rate: int, folder: str) -> list[str]:
    code = f'import sys; from endoscope_nodes.{node}_node import main; sys.exit(main())'
    arguments = ['-p', f'tick_rate:={rate}']
    if node == 'console':
        arguments += ['-p', 'source:=motion']
    if node == 'recorder':
        arguments += ['-p', f'bag:={folder}/bag']
    return [sys.executable, '-c', code, '--ros-args', *arguments]


class _Watcher:
    """Enables the slave of other processes and reads the motor driver's counts."""

    _PATIENCE_S = 120.0

    def __init__(self, domain: int) -> None:
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from rclpy.context import Context
        from std_msgs.msg import String

        from endoscope_nodes.names import OPERATING_STATE, STATE_COMMAND
        from endoscope_nodes.qos import EVENT, RESULT

        self._rclpy, self._string = rclpy, String
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self._node = rclpy.create_node(
            'bench_watcher', context=self._context, namespace='endoscope'
        )
        self._executor = rclpy.executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._commands = self._node.create_publisher(String, STATE_COMMAND, EVENT)
        self._state = ''
        self._values: dict[str, dict[str, str]] = {}
        self._node.create_subscription(String, OPERATING_STATE, self._on_state, RESULT)
        self._node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, EVENT)

    def _on_state(self, message: Any) -> None:
        self._state = message.data

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            self._values[status.name] = {v.key: v.value for v in status.values}

    def serve(self, seconds: float) -> None:
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def enable(self) -> None:
        deadline = time.monotonic() + self._PATIENCE_S
        while self._state != 'ENABLED' or len(self._values) < len(NODES):
            if time.monotonic() > deadline:
                raise RuntimeError(
                    f'not enabled: {self._values.get("supervisor: operating state")}'
                )
            self._commands.publish(self._string(data='enable'))
            self.serve(1.0)

    def counts(self) -> tuple[int, int, int]:
        self.serve(1.1)
        device = self._values['motor_driver: device']
        return (
            int(device['ticks']),
            int(device['missed ticks']),
            int(self._values['motor_driver: commands']['accepted']),
        )

    def __enter__(self) -> '_Watcher':
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.shutdown()


def _cpu_seconds(pid: int) -> float:
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
