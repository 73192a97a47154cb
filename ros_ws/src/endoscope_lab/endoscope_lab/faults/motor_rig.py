"""The nodes that move the motors, on emulated servos behind a real terminal, in real time."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import yaml
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.task import Future
from std_msgs.msg import String

from endoscope_core.exit_status import ClosedOnExit
from endoscope_devices.dynamixel.control_table import COUNT
from endoscope_emulators.dynamixel.process import EmulatorProcess
from endoscope_lab.faults.node_processes import NodeProcesses
from endoscope_nodes.names import (
    MOTOR_MEASURED,
    MOTORS,
    OPERATING_STATE,
    STATE_COMMAND,
    WIRES,
    WIRES_MEASURED,
)
from endoscope_nodes.nodes.compensator import CompensatorNode
from endoscope_nodes.nodes.master import MasterNode
from endoscope_nodes.nodes.motor_driver import MotorDriverNode
from endoscope_nodes.nodes.recorder import RecorderNode
from endoscope_nodes.nodes.supervisor import SupervisorNode
from endoscope_nodes.runtime.environment import EventlessNode
from endoscope_nodes.runtime.private_domain import process_domain
from endoscope_nodes.runtime.qos import EVENT, RESULT, SENSOR_ASKED, SENSOR_OFFERED
from endoscope_nodes.runtime.runtime import Runtime
from endoscope_nodes.runtime.streams import JointPublisher, JointSample, JointSubscription

BUS_PATIENCE_S = 240.0
RATE_HZ = 250
MOVING_RAD = 0.05
TENSION_N = 5.0
_LOOK_S = 0.005
_NODES: dict[str, type] = {
    'motor_driver': MotorDriverNode,
    'supervisor': SupervisorNode,
    'compensator': CompensatorNode,
    'master': MasterNode,
}


class MotorRig(ClosedOnExit):
    """Master, compensator, motor driver, supervisor and recorder, with two emulated servos.

    The master plays ``60 sin t``, uncompensated. The rig itself publishes the tension of the
    wires. Nodes `apart` run in processes of their own, so that they can be killed. Silence of the
    servos for `patience` s is a fault. The folder receives the terminal's link and the bag.
    """

    def __init__(
        self,
        folder: Path,
        apart: Sequence[str] = (),
        patience: float | None = None,
        domain: int | None = None,
    ) -> None:
        self.bag = folder / 'bag'
        self.emulator = EmulatorProcess(link=folder / 'servos')
        self.tension = TENSION_N
        self.weighing = True
        self.states: list[tuple[float, str]] = []
        self.shafts: list[tuple[float, JointSample]] = []
        self.messages: list[tuple[float, str, str]] = []
        domain = process_domain() if domain is None else domain
        overrides = self._parameters(apart, patience, folder / 'rig.yaml')
        self.runtime = Runtime(
            args=['--ros-args', '--log-level', 'fatal'],
            context=Context(),
            domain_id=domain,
            overrides={k: v for k, v in overrides.items() if k not in apart},
        )
        self._processes = NodeProcesses(domain, folder)
        for name in apart:
            self._processes.start(name, {name: overrides[name]})
        for name, factory in _NODES.items():
            if name not in apart:
                self.runtime.add(factory)
        self.runtime.add(RecorderNode)
        self.runtime.prepare()
        self.probe = EventlessNode('probe', context=self.runtime.context, namespace='endoscope')
        self.runtime.executor.add_node(self.probe)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._orders = self.probe.create_publisher(String, STATE_COMMAND, EVENT)
        self._wires = JointPublisher(self.probe, WIRES_MEASURED, WIRES, ('effort',), SENSOR_OFFERED)
        self.probe.create_subscription(String, OPERATING_STATE, self._on_state, RESULT)
        self.probe.create_subscription(DiagnosticArray, '/diagnostics', self._on_health, EVENT)
        JointSubscription(self.probe, MOTOR_MEASURED, MOTORS, self._on_shafts, SENSOR_ASKED)
        self.probe.create_timer(0.01, self._weigh, clock=self._steady)

    def _parameters(
        self, apart: Sequence[str], patience: float | None, rig_file: Path
    ) -> dict[str, dict[str, Any]]:
        driver = {'device': 'dynamixel', 'port': self.emulator.port, 'bus_rate': float(RATE_HZ)}
        parameters: dict[str, dict[str, Any]] = {
            'motor_driver': driver,
            'supervisor': {},
            'compensator': {'mode': 'none'},
            'master': {'source': 'motion'},
            'recorder': {'bag': str(self.bag)},
        }
        stream = {} if patience is None else {'timeouts': {'stream': patience}}
        rig_file.write_text(yaml.safe_dump(stream), encoding='utf-8')
        if patience is not None:
            driver['fault_after'] = patience
        first = next(name for name in _NODES if name not in apart)
        for name in (first, *apart):
            parameters[name] |= {'tick_rate': RATE_HZ, 'rig_file': str(rig_file)}
        return parameters

    def node(self, name: str) -> EventlessNode:
        """Return a node of this process by name; StopIteration if there is none."""
        return next(node for node in self.runtime.nodes if node.get_name() == name)

    @property
    def state(self) -> str:
        return self.states[-1][1] if self.states else ''

    def _on_state(self, message: String) -> None:
        self.states.append((time.monotonic(), message.data))

    def _on_health(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        self.messages += ((now, status.name, status.message) for status in message.status)

    def _on_shafts(self, sample: JointSample) -> None:
        self.shafts.append((time.monotonic(), sample))

    def _weigh(self) -> None:
        if self.weighing:
            self._wires.publish(time.time_ns(), *(self.tension,) * len(WIRES))

    def last_message(self, name: str) -> str:
        """Last diagnostic message of a subcomponent."""
        return next((text for _, which, text in reversed(self.messages) if which == name), '')

    def wait(self, condition: Callable[[], bool], patience: float = BUS_PATIENCE_S) -> bool:
        """Spin the nodes until a condition holds; whether it did within `patience` s."""
        future = Future()

        def look() -> None:
            if not future.done() and condition():
                future.set_result(None)

        timer = self.probe.create_timer(_LOOK_S, look, clock=self._steady)
        done = self.runtime.spin_until(future, patience)
        self.probe.destroy_timer(timer)
        return done

    def order(self, text: str) -> None:
        self._orders.publish(String(data=text))

    def enable_and_move(self) -> None:
        """Enable the slave and wait until the shafts swing; RuntimeError if they do not."""
        tried = [0.0]

        def moving() -> bool:
            now = time.monotonic()
            if self.state != 'ENABLED' and now - tried[0] > 0.1:
                tried[0] = now
                self.order('enable')
            swung = bool(self.shafts) and abs(self.shafts[-1][1].position[0]) > MOVING_RAD
            return swung and self.state == 'ENABLED'

        if not self.wait(moving):
            raise RuntimeError(f'the shafts do not move in {self.state or "no state"}')

    def block(self, seconds: float) -> None:
        """Block the executor of all nodes once, as a hanging callback does."""

        def hang() -> None:
            timer.cancel()
            time.sleep(seconds)

        timer = self.probe.create_timer(_LOOK_S, hang, clock=self._steady)

    def kill(self, name: str) -> None:
        """End the process of a node with SIGKILL."""
        self._processes.kill(name)

    def stopped_after(self, since: float) -> float | None:
        """Seconds from ``since`` (monotonic) to standstill of both shafts; None if they move."""
        last = since
        for device in (1, 2):
            trace = self.emulator.do('trace', device, since)
            window = 20
            for (then, before), (_, after) in zip(trace, trace[window:], strict=False):
                if abs(after - before) > COUNT:
                    last = max(last, then + window * 1e-3)
            if last >= trace[-1][0] - 0.1:
                return None
        return last - since

    def close(self) -> None:
        """End all nodes and processes, which completes the bag."""
        try:
            self.runtime.executor.remove_node(self.probe)
            self.probe.destroy_node()
            self.runtime.close()
        finally:
            self._processes.close()
            self.emulator.close()
