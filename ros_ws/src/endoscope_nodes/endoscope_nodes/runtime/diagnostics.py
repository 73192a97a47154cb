"""Statuses of the graph: results as dataclasses, and the health of a node on ``/diagnostics``.

Health is published once a second (REP-107: ``node: subcomponent``). The topic is one for all rigs
of a domain, so a node's name stands there with its namespace: ``/endoscope/motor_driver: device``.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import is_dataclass
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import msgspec
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.time import Time
from std_msgs.msg import Header

from endoscope_nodes.names import DIAGNOSTICS
from endoscope_nodes.runtime.qos import EVENT
from endoscope_nodes.runtime.ticker import Ticker

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR
STALE = DiagnosticStatus.STALE

Report = tuple[bytes, str, Mapping[str, object]]


def status(
    name: str, level: bytes, message: str, content: object, hardware_id: str = ''
) -> DiagnosticStatus:
    """Write a mapping, or a dataclass which :func:`from_status` reads, as a status.

    Every value is text, floats with nine digits. What is inside another one has its key behind that
    and a dot; a tuple is JSON, and None is left out.
    """
    values = [KeyValue(key=key, value=text) for key, text in _flat(content, '')]
    return DiagnosticStatus(
        name=name, level=level, message=message, hardware_id=hardware_id, values=values
    )


def _flat(content: Any, above: str) -> Iterator[tuple[str, str]]:
    for name, value in (content if isinstance(content, Mapping) else vars(content)).items():
        if isinstance(value, Mapping) or is_dataclass(value):
            yield from _flat(value, f'{above}{name}.')
        elif value is not None:
            yield f'{above}{name}', _text(value)


def _text(value: object) -> str:
    if isinstance(value, tuple | list):
        return json.dumps(value)
    return f'{value:.9g}' if isinstance(value, float) else str(value)


def from_status[T](kind: type[T], *statuses: DiagnosticStatus, **others: object) -> T:
    """Read a dataclass out of statuses; `others` are fields that have no key there.

    What may be None may be missing. What the dataclass does not know is ignored, but not within
    another one. ValueError where anything is not as its type says.
    """
    texts = {key: text for one in statuses for key, text in texts_of(one).items()}
    known = get_type_hints(kind).keys() - others
    made: T = _made(kind, {k: v for k, v in texts.items() if k.partition('.')[0] in known}, others)
    return made


def _made(kind: Any, texts: Mapping[str, str], others: Mapping[str, object]) -> Any:
    """Make a value of texts by what follows its key there: nothing, or a dot and another key."""
    if isinstance(kind, UnionType):
        kind = get_args(kind)[0]
    if '' in texts:
        if get_origin(kind) is tuple:
            return msgspec.json.decode(texts[''], type=kind)
        return msgspec.convert(texts[''], kind, strict=False)
    parts: dict[str, dict[str, str]] = {}
    for key, text in texts.items():
        name, _, below = key.partition('.')
        parts.setdefault(name, {})[below] = text
    types = get_type_hints(kind) if is_dataclass(kind) else {}
    needed = {name for name, one in types.items() if not isinstance(one, UnionType)}
    if odd := (needed - parts.keys() - others.keys()) | (parts.keys() - types):
        raise ValueError(f'missing or unknown: {", ".join(sorted(odd))}')
    return kind(**others, **{name: _made(types[name], part, {}) for name, part in parts.items()})


def texts_of(status: DiagnosticStatus) -> dict[str, str]:
    """Return the values of a status by their keys."""
    return {item.key: item.value for item in status.values}


def diagnostic_array(
    stamp_ns: int, *statuses: DiagnosticStatus, session: str = ''
) -> DiagnosticArray:
    """Put statuses into a message, of a motion session where it is of one."""
    header = Header(stamp=Time(nanoseconds=stamp_ns).to_msg(), frame_id=session)
    return DiagnosticArray(header=header, status=list(statuses))


class Diagnostics:
    """Collects the reports of a node's parts and publishes them at 1 Hz by its ticker."""

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
