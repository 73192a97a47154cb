"""What a process says of itself: the parameters that it was given, and when it can be operated."""

from collections.abc import Mapping, Sequence

from rclpy.clock import Clock, ClockType
from rclpy.logging import get_logger

from endoscope_core.atomic_output import with_final_names
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.matching import all_matched
from endoscope_nodes.runtime.parameters import as_typed

_LOOK_S = 0.2
_PATIENCE_LOOKS = 25


class Announcement:
    """Says once that the nodes of a process can be operated, and what to do next.

    That is when they have found each other and none of them waits for anything.
    """

    def __init__(
        self, nodes: Sequence[EndoscopeNode], process_parameters: Mapping[str, object]
    ) -> None:
        self._nodes = nodes
        self._looks = 0
        self._logger = nodes[0].get_logger() if len(nodes) == 1 else get_logger('graph')
        for node in nodes:
            given = {**process_parameters, **node.given} if node is nodes[0] else node.given
            told = [f'{name}:={as_typed(value)}' for name, value in given.items()]
            if told:
                node.get_logger().info(with_final_names(f'with {", ".join(told)}'))
        self._timer = nodes[0].create_timer(
            _LOOK_S, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def _look(self) -> None:
        waiting = self._waiting()
        if not waiting:
            self._timer.cancel()
            self._logger.info(self._ready())
            return
        self._looks += 1
        if self._looks == _PATIENCE_LOOKS:
            self._logger.warning(f'not ready yet: {waiting}')

    def _waiting(self) -> str:
        waiting = [node.waiting for node in self._nodes if node.waiting]
        if not self._nodes[0].ticker.now_ns():
            waiting.append('simulated time has not begun')
        if not waiting and not all_matched(self._nodes):
            return 'the nodes have not found each other'
        return '; '.join(waiting)

    def _ready(self) -> str:
        nodes, ticker = self._nodes, self._nodes[0].ticker
        pace = 'in simulated time' if ticker.simulated else f'at {ticker.rate} Hz'
        pace += ', no faster than real time' * ticker.paced
        said = '; '.join(filter(None, (node.announcement for node in nodes)))
        return f'ready in {nodes[0].get_namespace()} {pace}' + (f': {said}' if said else '')
