"""Health of a node on ``/diagnostics``, once a second (REP-107: ``node: subcomponent``).

The topic is one for all rigs of a domain, so a node's name stands there with its namespace:
``/endoscope/motor_driver: device``.
"""

from collections.abc import Callable, Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.time import Time

from endoscope_nodes.names import DIAGNOSTICS
from endoscope_nodes.runtime.qos import EVENT
from endoscope_nodes.runtime.ticker import Ticker

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR
STALE = DiagnosticStatus.STALE

Report = tuple[bytes, str, Mapping[str, object]]


def status(
    name: str, level: bytes, message: str, values: Mapping[str, object], hardware_id: str = ''
) -> DiagnosticStatus:
    """Make one status; every value is written as text, floats with nine digits."""
    return DiagnosticStatus(
        name=name,
        level=level,
        message=message,
        hardware_id=hardware_id,
        values=[KeyValue(key=k, value=_text(v)) for k, v in values.items()],
    )


def diagnostic_array(stamp_ns: int, *statuses: DiagnosticStatus) -> DiagnosticArray:
    """Put statuses into a message."""
    message = DiagnosticArray(status=list(statuses))
    message.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
    return message


def _text(value: object) -> str:
    return f'{value:.9g}' if isinstance(value, float) else str(value)


class Diagnostics:
    """Collects the reports of a node's parts and publishes them at the pace of its ticker: 1 Hz.

    The node's name, with namespace, is the first half of every status name.
    """

    def __init__(self, node: Node, ticker: Ticker) -> None:
        self._node = node
        self._ticker = ticker
        self._reports: list[tuple[str, str, Callable[[], Report]]] = []
        self._publisher = node.create_publisher(DiagnosticArray, DIAGNOSTICS, EVENT)
        ticker.every(1.0, self.publish)

    def add(self, subcomponent: str, report: Callable[[], Report], hardware_id: str = '') -> None:
        """Have ``report() -> (level, message, values)`` published for a subcomponent."""
        name = f'{self._node.get_fully_qualified_name()}: {subcomponent}'
        self._reports.append((name, hardware_id, report))

    def publish(self) -> None:
        """Publish all reports now, unless time has not begun."""
        now = self._ticker.now_ns()
        if now == 0 or not self._reports:
            return
        reports = [status(name, *report(), hardware) for name, hardware, report in self._reports]
        self._publisher.publish(diagnostic_array(now, *reports))
