"""Drives the motor shafts, and is the simulated slave where there is no hardware."""

from collections import deque
from dataclasses import dataclass

from endoscope_core.safety import CommandGate, CommandLimits, OperatingState, Refusal
from endoscope_devices.motor_device import MotorDevice, MotorReading
from endoscope_devices.simulated_slave import SimulatedSlave
from endoscope_nodes.command_report import CommandReport
from endoscope_nodes.diagnostics import ERROR, OK, WARN, Report
from endoscope_nodes.endoscope_node import EndoscopeNode
from endoscope_nodes.joint_stream import JointPublisher, JointSample, JointSubscription
from endoscope_nodes.names import (
    JOINTS,
    MOTOR_COMMAND,
    MOTOR_MEASURED,
    MOTORS,
    SIMULATED_BENDING,
    SIMULATED_WIRES,
    WIRES,
)
from endoscope_nodes.parameters import parameter
from endoscope_nodes.plant_parameter import load_plant_parameter
from endoscope_nodes.qos import COMMAND, LOCK_STEP, SENSOR_OFFERED
from endoscope_nodes.runtime import Runtime, run_nodes
from endoscope_nodes.state_watch import StateWatch


@dataclass(frozen=True)
class MotorDriverParameters:
    """Parameters of the motor driver."""

    device: str = parameter('simulated', 'what is driven', choices=('simulated',))
    plant_file: str = parameter(
        '', 'plant.yaml of the simulated slave; empty for the nominal plant'
    )
    seed: int = parameter(1, 'seed of the simulated sensor noise', low=0)
    shaft_limit: float = parameter(
        1.6, 'largest shaft angle obeyed, either way', unit='rad', low=0.0, high=20.0
    )
    max_speed: float = parameter(
        40.0, 'largest speed of the shaft between two commands', unit='rad/s', low=0.0
    )
    max_step: float = parameter(
        0.1, 'largest distance of the first command from the measured position', unit='rad', low=0.0
    )
    command_timeout: float = parameter(
        0.1,
        'a command older than this is not obeyed, and without a newer one the measured '
        'position is held',
        unit='s',
        low=0.001,
        high=1.0,
    )


class MotorDriverNode(EndoscopeNode):
    """Obeys ``motor/servo_jp`` as far as it is safe, and publishes what the shafts do.

    Every tick the newest obeyed command goes to the device and its reading is published.  Without
    fresh commands, and in any state but ``ENABLED``, the position measured at that moment is held.
    The simulated slave also publishes the noise-free tensions and angles that the simulated load
    cells and tracker read.
    """

    def __init__(self, runtime: Runtime) -> None:
        super().__init__('motor_driver', runtime)
        self._settings = self.parameters(MotorDriverParameters)
        p = self._settings
        self.gate = CommandGate(
            CommandLimits(
                (-p.shaft_limit,) * 2,
                (p.shaft_limit,) * 2,
                p.max_speed,
                p.max_step,
                round(p.command_timeout * 1e9),
            )
        )
        self._slave = SimulatedSlave(
            load_plant_parameter('motor_driver', p.plant_file), MOTORS, p.seed
        )
        self._device: MotorDevice = self._slave
        self._device.open()
        self._goal: tuple[float, ...] = (0.0,) * len(MOTORS)
        self._reading: MotorReading | None = None
        self._holding = True
        self._holds = 0
        self.latency_ns: deque[int] = deque(maxlen=1000)
        self._measured = JointPublisher(
            self, MOTOR_MEASURED, MOTORS, ('position', 'velocity', 'effort'), SENSOR_OFFERED
        )
        self._wires = JointPublisher(self, SIMULATED_WIRES, WIRES, ('effort',), LOCK_STEP)
        self._bending = JointPublisher(self, SIMULATED_BENDING, JOINTS, ('position',), LOCK_STEP)
        self._state = StateWatch(self, self.ticker, self._on_state)
        JointSubscription(
            self,
            MOTOR_COMMAND,
            MOTORS,
            self._on_command,
            COMMAND,
            exact=True,
            on_malformed=self._on_malformed,
        )
        self.diagnostics.add('commands', CommandReport(self.gate))
        self.diagnostics.add('device', self._report_device, p.device)
        self.ticker.add(self._on_tick)

    def _on_state(self, state: OperatingState) -> None:
        enabled = state is OperatingState.ENABLED
        if enabled:
            self.gate.reset()
        self._device.set_torque(enabled)
        self._hold()

    def _hold(self) -> None:
        if not self._holding and self._reading is not None:
            self._goal = self._reading.position
            self._holds += 1
        self._holding = True

    def _on_malformed(self, reason: str) -> None:
        self.gate.refuse(Refusal.MALFORMED, reason)

    def _on_command(self, sample: JointSample) -> None:
        if not self._state.enabled:
            self.gate.refuse(Refusal.NOT_ENABLED)
            return
        held = self._goal if self._reading is None else self._reading.position
        if (
            self.gate.check(
                sample.stamp_ns, sample.position, sample.velocity, self.ticker.monotonic_ns(), held
            )
            is None
        ):
            self._goal = sample.position
            self._holding = False
            if not self.ticker.simulated:
                self.latency_ns.append(self.ticker.now_ns() - sample.stamp_ns)

    def _on_tick(self, stamp_ns: int, periods: int) -> None:
        if not self._holding and not (
            self.gate.is_fresh(self.ticker.monotonic_ns()) and self._state.enabled
        ):
            self._hold()
        reading = self._device.exchange(self._goal, periods)
        if reading is None:
            return
        self._reading = reading
        self._measured.publish(stamp_ns, *reading.position, *reading.velocity, *reading.effort)
        self._wires.publish(stamp_ns, *self._slave.tension)
        self._bending.publish(stamp_ns, *self._slave.bending)

    def _report_device(self) -> Report:
        trouble, values = self._device.health()
        values |= {
            'ticks': self.ticker.ticks,
            'missed ticks': self.ticker.missed,
            'published': self._measured.count,
            'times held': self._holds,
            'holding': self._holding,
        }
        if self.latency_ns:
            ordered = sorted(self.latency_ns)
            values['command latency p50 [ms]'] = ordered[len(ordered) // 2] * 1e-6
            values['command latency p99 [ms]'] = ordered[len(ordered) * 99 // 100] * 1e-6
        if trouble:
            return ERROR, trouble, values
        if self._reading is None:
            return WARN, 'no reading yet', values
        return OK, 'holding' if self._holding else 'following commands', values

    def close(self) -> None:
        """Let go of the device."""
        self._device.close()


def main() -> int:
    """Run the motor driver in a process of its own."""
    return run_nodes([MotorDriverNode])
