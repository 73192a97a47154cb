"""Measures the graph with each node in a process of its own."""

import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from typing import Any, Self

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

from endoscope_bringup.benches.process_cpu import cpu_seconds
from endoscope_core.safety import OperatingState
from endoscope_nodes.discovery import stay_on_this_machine
from endoscope_nodes.names import OPERATING_STATE, STATE_COMMAND
from endoscope_nodes.qos import EVENT, RESULT

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
CARRIED = 0.99
_OBEYING = ('compensator', 'motor_driver')
_SETTLING_S = 2.0


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
    load
        Load average of the machine at the end.
    state
        Operating state at the end.
    hops
        What became of the commands from node to node: how many the console sent, how many of them
        the compensator and the motor driver obeyed, and why the others were refused. What is
        missing beyond the refusals was replaced by newer ones before it was read.
    """

    rate: int
    ticks: float
    commands: float
    cores: float
    load: float
    state: str
    hops: str

    @property
    def carried(self) -> bool:
        """Whether this rate is kept up with."""
        return self.ticks >= CARRIED and self.commands >= CARRIED

    def __str__(self) -> str:
        return (
            f'{len(NODES)} processes at {self.rate} Hz: {100 * self.ticks:.1f} % of ticks, '
            f'{100 * self.commands:.1f} % of commands obeyed, {self.cores:.2f} cores, '
            f'load average {self.load:.1f}'
            + ('' if self.carried else f': not carried, {self.state}, {self.hops}')
        )


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
            watcher.serve(_SETTLING_S)
            before = watcher.counts()
            cpu = sum(cpu_seconds(p.pid) for p in processes)
            began = time.monotonic()
            watcher.serve(seconds)
            after, elapsed = watcher.counts(), time.monotonic() - began
            state = watcher.state
            cpu = sum(cpu_seconds(p.pid) for p in processes) - cpu
        finally:
            for process in processes:
                process.terminate()
            for process in processes:
                process.wait(timeout=30)
    done = after - before
    due = done['ticks'] + done['missed ticks']
    return ProcessesFigure(
        rate=rate,
        ticks=done['ticks'] / due,
        commands=done['motor_driver accepted'] / due,
        cores=cpu / elapsed,
        load=os.getloadavg()[0],
        state=state,
        hops=_hops(done),
    )


def _hops(done: Counter[str]) -> str:
    text = f'the console sent {done["sent"]}'
    for node in _OBEYING:
        refused = [f'{n} {key}' for key, n in done.items() if key.startswith(f'{node} refused')]
        text += ', '.join([f', {node} obeyed {done[f"{node} accepted"]}', *refused])
    return text


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
        self._context = Context()
        stay_on_this_machine()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self._node = rclpy.create_node(
            'bench_watcher', context=self._context, namespace='endoscope'
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._commands = self._node.create_publisher(String, STATE_COMMAND, EVENT)
        self.state = ''
        self._values: dict[str, dict[str, str]] = {}
        self._node.create_subscription(String, OPERATING_STATE, self._on_state, RESULT)
        self._node.create_subscription(DiagnosticArray, '/diagnostics', self._on_health, EVENT)

    def _on_state(self, message: Any) -> None:
        self.state = message.data

    def _on_health(self, message: Any) -> None:
        for status in message.status:
            self._values[status.name.removeprefix('/endoscope/')] = {
                v.key: v.value for v in status.values
            }

    def serve(self, seconds: float) -> None:
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def enable(self) -> None:
        """Wait until every node is heard and the slave follows commands."""
        deadline = time.monotonic() + self._PATIENCE_S
        while self.state != OperatingState.ENABLED or len(self._heard()) < len(NODES):
            if time.monotonic() > deadline:
                silent = sorted(set(NODES) - self._heard())
                raise RuntimeError(f'{self.state or "no state"}; silent: {", ".join(silent)}')
            self._commands.publish(String(data='enable'))
            self.serve(1.0)

    def _heard(self) -> set[str]:
        return {name.partition(':')[0] for name in self._values}

    def counts(self) -> Counter[str]:
        """Ticks of the motor driver, and of each node what it sent, obeyed and refused."""
        self.serve(1.1)
        device = self._values['motor_driver: device']
        found = Counter({key: int(device[key]) for key in ('ticks', 'missed ticks')})
        found['sent'] = int(self._values['console: commands']['published'])
        for node in _OBEYING:
            for key, value in self._values[f'{node}: commands'].items():
                found[f'{node} {key}'] = int(value)
        return found

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.shutdown()
