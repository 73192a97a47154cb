"""The whole graph in this process on a simulated slave, and an operator at its topics."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rclpy.context import Context
from rclpy.task import Future

from endoscope_core.exit_status import ClosedOnExit
from endoscope_core.rig import Rig
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import GraphError
from endoscope_nodes.client.graph_parameters import set_parameters
from endoscope_nodes.graph import CONTROL_NODES, SLAVE_NODES
from endoscope_nodes.names import CLOCK_NODE, MOTOR_MEASURED
from endoscope_nodes.nodes.recorder import RecorderNode
from endoscope_nodes.nodes.simulation_clock import SimulationClockNode
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.private_domain import process_domain
from endoscope_nodes.runtime.runtime import FOREVER_S, Runtime

DEMO_PATIENCE_S = 60.0
POLL_S = 0.05
RATE = {True: 500, False: 1000}
"""Ticks a second in lock-step and in real time."""
NODES = (*SLAVE_NODES, *CONTROL_NODES)


class LiveGraph(ClosedOnExit):
    """All nodes, recorder included, in this process; with a bag it records until :meth:`stop`."""

    # In lock-step simulated time goes on as the nodes follow, else the wall clock gives it.

    def __init__(
        self,
        bag: Path | None,  # folder to be made for the recording
        domain: int | None = None,  # by default this process's own
        *,
        lock_step: bool,  # whether time is simulated
        overrides: dict[str, dict[str, object]],  # parameters by node
        rate: int = 0,  # ticks a second, by default `RATE`
        rig: Rig | None = None,  # by default the shipped one
        nodes: Sequence[Callable[[NodeContext], EndoscopeNode]] = NODES,
        log_level: str = 'fatal',  # the least severe that nodes print
    ) -> None:
        given = dict(overrides)
        if lock_step:
            # Load cells may fall silent.
            clock = {'timeout': DEMO_PATIENCE_S, 'wait_for': [MOTOR_MEASURED]}
            given[CLOCK_NODE] = clock | overrides.get(CLOCK_NODE, {})
        if bag is not None:
            given['recorder'] = {'bag': str(bag)}
        arguments = ['--ros-args', '--log-level', log_level]
        arguments += ['-p', f'use_sim_time:={str(lock_step).lower()}']
        arguments += ['-p', f'tick_rate:={rate or RATE[lock_step]}']
        domain = process_domain() if domain is None else domain
        self._runtime = Runtime(arguments, Context(), domain, given, rig=rig)
        try:
            for factory in nodes:
                self._runtime.add(factory)
            self._recorder = None if bag is None else self._runtime.add(RecorderNode)
            self.node = self._runtime.add(lambda runtime: EndoscopeNode('operator', runtime))
            self._pose = self._runtime.pose_of(self.node)
            self.client = GraphClient(self.node, self.advance, self.now)
            self._clock = self._runtime.add(SimulationClockNode) if lock_step else None
            self._runtime.prepare()
            self._connect()
        except BaseException:
            self._runtime.close()
            raise

    def _connect(self) -> None:
        limit = time.monotonic() + DEMO_PATIENCE_S
        while not (self.client.is_connected() and self._runtime.connected()):
            if time.monotonic() > limit:
                raise GraphError('the nodes did not find each other: is multicast allowed?')
            self._runtime.spin_until(Future(), POLL_S)
        self.advance(0.5)

    def now(self) -> float:
        """Time of the graph in s."""
        return self.node.ticker.now_ns() * 1e-9

    def advance(self, seconds: float) -> None:
        """Let time go on."""
        if self._clock is None:
            self._runtime.spin_until(Future(), seconds)
            return
        done = self._clock.advance(seconds)
        self._runtime.spin_until(done, FOREVER_S)
        done.result()

    def set(self, node: str, **values: Any) -> None:
        """Set parameters of a node."""
        set_parameters(self.client, node, values)

    @property
    def shafts(self) -> tuple[float, ...]:
        """Measured angles of the shafts in rad, shape (J,)."""
        return self._pose.shafts() or ()

    def stop(self) -> dict[str, int]:
        """End the recording, and return how many messages of which topic it missed."""
        return {} if self._recorder is None else dict(self._recorder.stop().lost)

    def close(self) -> None:
        """End all nodes."""
        try:
            self.client.close()
        finally:
            self._runtime.close()
