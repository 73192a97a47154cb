"""A client of the node graph that does what an operator would: enable, calibrate, choose, play."""

import struct
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.client import Client
from rclpy.parameter import Parameter
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from endoscope_core.errors import EndoscopeError
from endoscope_nodes.endoscope_node import EndoscopeNode
from endoscope_nodes.names import (
    CALIBRATION_COMMAND,
    CALIBRATION_RESULT,
    CALIBRATION_RUN,
    OPERATING_STATE,
    STATE_COMMAND,
)
from endoscope_nodes.qos import COMMAND, EVENT, RESULT
from endoscope_nodes.runtime import Runtime

DIRECTED = ('console', 'compensator', 'controller')
_STAMP = struct.Struct('<iI')


class GraphRefusedError(EndoscopeError):
    """A node of the graph refused what the procedure asked of it."""


class DirectorNode(EndoscopeNode):
    """Asks the other nodes, through their topics and services, and remembers their answers.

    Attributes
    ----------
    operating_state : str
        Last state announced by the supervisor; empty before the first.
    calibration_result : DiagnosticArray or None
        Last result announced.
    last_calibration_ns : int
        Stamp of the last command that calibration gave; 0 before the first.
    """

    def __init__(self, runtime: Runtime) -> None:
        super().__init__('director', runtime)
        self.operating_state = ''
        self.calibration_result: DiagnosticArray | None = None
        self.last_calibration_ns = 0
        self._state_commands = self.create_publisher(String, STATE_COMMAND, EVENT)
        self.create_subscription(String, OPERATING_STATE, self._on_state, RESULT)
        self.create_subscription(DiagnosticArray, CALIBRATION_RESULT, self._on_result, RESULT)
        self.create_subscription(
            JointState, CALIBRATION_COMMAND, self._on_calibration, COMMAND, raw=True
        )
        self._calibrate = self.create_client(Trigger, CALIBRATION_RUN)
        self._setters: dict[str, Client] = {
            name: self.create_client(SetParameters, f'{name}/set_parameters') for name in DIRECTED
        }

    def ready(self) -> bool:
        """Whether all services that the procedure needs are there."""
        return all(
            client.service_is_ready() for client in (self._calibrate, *self._setters.values())
        )

    def command_state(self, command: str) -> None:
        """Publish a state command: `enable`, `disable`, `pause`, `resume`, `home`."""
        self._state_commands.publish(String(data=command))

    def request_parameters(self, node: str, **values: Any) -> Future:
        """Ask a node to take parameter values; see `check_parameters_taken`."""
        request = SetParameters.Request(
            parameters=[
                Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
            ]
        )
        return self._setters[node].call_async(request)

    def request_calibration(self) -> Future:
        """Call `calibration/run`; its result comes later, on its topic."""
        self.calibration_result = None
        return self._calibrate.call_async(Trigger.Request())

    def _on_state(self, message: String) -> None:
        self.operating_state = message.data

    def _on_result(self, message: DiagnosticArray) -> None:
        self.calibration_result = message

    def _on_calibration(self, data: bytes) -> None:
        seconds, nanoseconds = _STAMP.unpack_from(data, 4)
        self.last_calibration_ns = seconds * 1_000_000_000 + nanoseconds


def check_parameters_taken(node: str, response: SetParameters.Response) -> None:
    """Raise if a node refused a parameter.

    Raises
    ------
    GraphRefusedError
        With the node's reason.
    """
    for result in response.results:
        if not result.successful:
            raise GraphRefusedError(f'{node} refused a parameter: {result.reason}')


def values_of(result: DiagnosticArray) -> dict[str, str]:
    """Keys and values of a calibration's result.

    Raises
    ------
    GraphRefusedError
        If it tells of an aborted calibration.
    """
    status = result.status[0]
    if status.level != DiagnosticStatus.OK:
        raise GraphRefusedError(f'calibration: {status.message}')
    return {item.key: item.value for item in status.values}
