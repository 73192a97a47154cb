"""The server's node in the graph: subscribed in one thread, services in another, calls from any."""

import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.task import Future

from endoscope_console.explanations import NOMINAL
from endoscope_console.pictures import Pictures
from endoscope_core.choices import ADAPTIVE_PHYSICAL, BY_CLASS, BY_PLANT, PHYSICAL, PLAYS
from endoscope_core.errors import EndoscopeError
from endoscope_core.rig import load_rig
from endoscope_nodes.client.calibration_result import REACH
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import MASTER, GraphError, Health
from endoscope_nodes.client.graph_parameters import read_parameter, set_parameters
from endoscope_nodes.client.handle_sender import handle_senders
from endoscope_nodes.client.plant_adoption import AdoptedPlants
from endoscope_nodes.names import CONSOLE_LOG, FINISHED, MASTER_NODE
from endoscope_nodes.runtime.diagnostics import OK, WARN, diagnostic_array, status
from endoscope_nodes.runtime.environment import joined_node
from endoscope_nodes.runtime.qos import EVENT

NODE = 'console_web'
ANSWER_S = 10.0

_ASKED = ('source', 'scale')
_POLL_S = 0.01
_LISTED_S = 2.0
_SETTINGS_NS = 1_000_000_000
_SERVED_UNTIL_S = 5.0


class _Client(GraphClient):
    """Reads its topics in the thread that made it; other threads may wait for what it hears."""

    def __init__(self, node: Node) -> None:
        self._reader = threading.get_ident()
        self.ends = threading.Event()
        super().__init__(node, self._wait)

    def _wait(self, seconds: float) -> None:
        if self.ends.wait(min(seconds, _POLL_S)):
            raise GraphError('the server of the page ends')

    def hear(self) -> None:
        """Take all that has come, in the one thread that may."""
        if threading.get_ident() == self._reader:
            super().hear()


def is_calibrated(calibration: Health | None) -> bool:
    """Whether the last calibration has found a class: one that was aborted or refused has not."""
    return calibration is not None and calibration.level == 0


def identified(calibration: Health | None) -> bool:
    """Whether a calibration has found the plant of each joint, and so how far it can be bent."""
    return calibration is not None and any(key.startswith(REACH) for key in calibration.values)


@dataclass(frozen=True)
class Settings:
    """Last known settings of the master."""

    source: str = ''  # where its commands come from; empty before it was asked
    scale: float = 1.0  # slave motion for one radian of the handle


class GraphSide:
    """Subscriptions and calls of the server to a graph."""

    def __init__(self, client: _Client, pictures: Pictures, services: threading.Thread) -> None:
        self._services = services
        self.client = client
        self.plants = AdoptedPlants(client)
        self.pictures = pictures
        # Of the master; asked for each second, and by whoever changed them.
        self.settings = Settings()
        self.heard_ns = 0  # operating state, by a steady clock
        # Status with which the graph of this program has ended; None while it runs, or is
        # another's.
        self.ended: int | None = None
        self._state_ns = 0
        self._asking: Future | None = None
        self._asked_ns = 0
        self._log = client.node.create_publisher(DiagnosticArray, CONSOLE_LOG, EVENT)

    def hear(self, now_ns: int) -> None:
        """Take all that has come until now, a steady time in ns, and ask for the settings."""
        if not self._services.is_alive():
            raise RuntimeError('the thread that takes answers of services has ended')
        client = self.client
        client.hear()
        if client.state_ns != self._state_ns:
            self._state_ns = client.state_ns
            self.heard_ns = now_ns - max(0, time.time_ns() - client.state_ns)
        if now_ns - self._asked_ns > _SETTINGS_NS:
            self.ask_for_settings(now_ns)

    def ask_for_settings(self, now_ns: int) -> None:
        """Ask the master what it is set to, at a time in ns; the answer comes later."""
        self._asked_ns = now_ns
        asking = self.client.client(GetParameters, f'{MASTER_NODE}/get_parameters')
        if asking.service_is_ready():
            if self._asking is not None and not self._asking.done():
                asking.remove_pending_request(self._asking)
            self._asking = asking.call_async(GetParameters.Request(names=list(_ASKED)))
            self._asking.add_done_callback(self._on_settings)

    def _on_settings(self, future: Future) -> None:
        answer: Any = future.result()
        if answer is not None and future is self._asking and len(answer.values) == len(_ASKED):
            source, scale = map(parameter_value_to_python, answer.values)
            self.settings = Settings(str(source), float(scale))

    @property
    def plays(self) -> bool:
        """Whether the master moves the slave by itself."""
        health = self.client.health.get(MASTER)
        return self.settings.source in PLAYS and (
            health is None or health.values[FINISHED] != 'True'
        )

    def others_at_the_handle(self) -> list[str]:
        """Names of other publishers of the handle topics; another page's server has the same."""
        return handle_senders(self.client.node)

    def plant(self) -> str:
        """File of the plant that the graph simulates; a name of the shipped one, or empty."""
        try:
            file = read_parameter(self.client, 'motor_driver.plant_file', _LISTED_S).value
            return str(file or load_rig(self.rig_file() or None).simulation.plant or NOMINAL)
        except EndoscopeError:
            return ''

    def rig_file(self) -> str:
        """File of the rig that the graph has; empty for the one that is shipped."""
        return str(read_parameter(self.client, 'motor_driver.rig_file', _LISTED_S).value)

    def compensate(self, mode: str) -> None:
        """Set the compensator's mode; the physical ones know the tube itself where it was found."""
        physical = mode in (PHYSICAL, ADAPTIVE_PHYSICAL)
        by_plant = physical and identified(self.client.calibration)
        values = {'mode': mode, 'selected_by': BY_PLANT if by_plant else BY_CLASS}
        set_parameters(self.client, 'compensator', values, ANSWER_S)

    def log(self, order: str, operator: str, address: str, ok: bool, why: str) -> None:
        """Publish an order and its outcome in the graph."""
        node = self.client.node
        became = (why or 'done') if ok else f'refused: {why}'
        values = {
            'operator': operator,
            'address': address,
            'order': order,
            'answer': 'done' if ok else 'refused',
            'why': why,
        }
        name, level = f'{node.get_fully_qualified_name()}: order', OK if ok else WARN
        entry = status(name, level, f'{order}: {became}', values)
        self._log.publish(diagnostic_array(time.time_ns(), entry))

    def close(self) -> None:
        """Hear and ask no more."""
        self.client.ends.set()
        self.client.node.destroy_publisher(self._log)
        self.pictures.close()


@contextmanager
def graph_side(namespace: str, section_length: float) -> Iterator[GraphSide]:
    """Join a graph, heard by the calling thread; the bending section is `section_length` m long."""
    with ExitStack() as stack:
        node = stack.enter_context(joined_node(NODE, namespace))
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)
        ended = Future(executor=executor)
        thread = threading.Thread(
            target=executor.spin_until_future_complete, args=(ended,), name='services', daemon=True
        )
        client = stack.enter_context(_Client(node))
        side = GraphSide(client, Pictures(node, section_length), thread)
        stack.callback(side.close)
        thread.start()

        def stop() -> None:
            ended.set_result(None)
            executor.wake()
            thread.join(_SERVED_UNTIL_S)
            executor.shutdown()

        # First of all at the end: it must not wait for what is closed by then.
        stack.callback(stop)
        yield side
