"""The one place that starts, spins and shuts down ROS, for one node or for many in a process."""

import gc
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.exceptions import (
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidParameterTypeException,
)
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import LoggingSeverity, get_logger, set_logger_level
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from endoscope_core.atomic_output import with_final_names
from endoscope_core.exit_status import ClosedOnExit
from endoscope_core.rig import Rig
from endoscope_nodes.runtime.declared_parameters import check_overrides
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.environment import log_as_asked, stay_on_this_machine
from endoscope_nodes.runtime.node_context import NodeContext, all_matched
from endoscope_nodes.runtime.parameters import ParameterError, as_typed
from endoscope_nodes.runtime.real_time import (
    enter_real_time,
    granted_priority,
    start_in_the_background,
    threads_of_this_process,
)
from endoscope_nodes.runtime.stop_signals import StopSignals

# An unbounded spin of the EventsExecutor never returns in the Jazzy wheels; a bounded one does.
# Eleven days.
FOREVER_S = 1e6
SHUTDOWN_S = 2.0
SWITCH_INTERVAL_S = 5e-5
_CARRY_ON_S = 0.1
# A collection of the second generation takes most of a tick: ten times rarer than by default.
GC_THRESHOLDS = (7000, 10, 10)

N = TypeVar('N', bound=EndoscopeNode)
_LOOK_S = 0.2
_PATIENCE_LOOKS = 25


class Runtime(NodeContext, ClosedOnExit):
    """Nodes composed in one process around one executor, one ticker and one context.

    By default it takes command line and ROS domain of the process, and the rig that the first node
    names. `overrides`, by node, win. Unreadable ROS arguments raise `ParameterError`.
    """

    def __init__(
        self,
        args: Sequence[str] | None = None,
        context: Context | None = None,
        domain_id: int | None = None,
        overrides: Mapping[str, Mapping[str, object]] | None = None,
        rig: Rig | None = None,
    ) -> None:
        super().__init__(
            rclpy.get_default_context() if context is None else context,
            sys.argv[1:] if args is None else args,
            overrides,
            rig,
        )
        stay_on_this_machine()
        log_as_asked()
        self._background_threads = threads_of_this_process()
        # What rcl says to the log besides raising it would be a second line.
        set_logger_level('rcl', LoggingSeverity.FATAL)
        try:
            rclpy.init(
                args=self._args,
                context=self.context,
                domain_id=domain_id,
                signal_handler_options=SignalHandlerOptions.NO,
            )
        except rclpy_implementation.UnknownROSArgsError as error:
            raise ParameterError(
                f'unknown ROS arguments {str(error).strip("[]")}; see --help'
            ) from error
        except rclpy_implementation.RCLError as error:
            raise ParameterError(str(error).partition(', at /')[0]) from error
        finally:
            set_logger_level('rcl', LoggingSeverity.UNSET)
        self.executor = EventsExecutor(context=self.context)
        self.nodes: list[EndoscopeNode] = []
        self._exit_codes: list[int] = []
        self._closed = False

    def add(self, factory: Callable[[NodeContext], N]) -> N:
        """Build a node and let the executor serve it."""
        node = factory(self)
        self.nodes.append(node)
        self.executor.add_node(node)
        return node

    def remove(self, node: EndoscopeNode) -> None:
        """Close a node and take it out of the process; the others go on."""
        self.nodes.remove(node)
        try:
            node.close()
        finally:
            self._exit_codes.append(node.exit_code)
            if self._ticker is not None:
                self._ticker.forget((node, node.diagnostics))
            self._leave_pose(node)
            self.executor.remove_node(node)
            node.destroy_node()

    def prepare(self, whole_process: bool = False) -> None:
        """Check the parameters and make ready for a long life; before the nodes are served."""
        self.check_parameters()
        # Where nothing but the nodes runs here, a priority that the system grants may be taken
        # unasked.
        self._enter_real_time(whole_process)
        # A collection that walks over all that was imported would cost many ticks.
        gc.collect()
        gc.freeze()
        gc.set_threshold(*GC_THRESHOLDS)
        # By default a thread that writes a recording may keep the executor waiting for 5 ms.
        sys.setswitchinterval(SWITCH_INTERVAL_S)

    def _enter_real_time(self, whole_process: bool) -> None:
        node, wanted = self.nodes[0], self._real_time
        if wanted.realtime_priority < 0:
            unasked = whole_process and not self.ticker.simulated
            wanted = replace(wanted, realtime_priority=granted_priority() if unasked else 0)
            if wanted.realtime_priority:
                node.get_logger().info(f'real-time priority {wanted.realtime_priority} is taken')
        if not wanted.realtime_priority and not wanted.cores:
            return
        urgent = threads_of_this_process() - self._background_threads
        enter_real_time(node.get_name(), wanted, urgent, self.ticker.simulated)

        def carry_on() -> None:
            timer.cancel()
            start_in_the_background()

        # The executor starts the threads of its timers, which are urgent, when it begins to spin.
        timer = node.create_timer(
            _CARRY_ON_S, carry_on, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def check_parameters(self) -> None:
        """Refuse overrides that no node knows."""
        names = [node.get_name() for node in self.nodes]
        for name in self._overrides:
            if name not in names:
                raise ParameterError(
                    f"there are parameters for '{name}', but only {', '.join(names)} run here"
                )
        check_overrides(list(self.nodes))

    def spin(self) -> None:
        """Serve all nodes until :meth:`stop` is called or the context is shut down."""
        try:
            self.spin_until(self._stop, FOREVER_S)
        except ExternalShutdownException:
            return

    def spin_until(self, future: Future, timeout_s: float) -> bool:
        """Serve all nodes until ``future`` is done; say whether it was in time."""
        self.executor.spin_until_future_complete(future, timeout_sec=timeout_s)
        return future.done()

    @property
    def exit_code(self) -> int:
        """The gravest exit code of all nodes, those that have ended included."""
        return max(self._exit_codes + [node.exit_code for node in self.nodes], default=0)

    def close(self) -> None:
        """Close and destroy every node, then shut the context down, whatever goes wrong between."""
        if self._closed:
            return
        self._closed = True
        try:
            self._close_nodes()
        finally:
            try:
                # Like its spins, an unbounded shutdown of this executor may never return.
                self.executor.shutdown(timeout_sec=SHUTDOWN_S)
            finally:
                self.context.try_shutdown()

    def _close_nodes(self) -> None:
        if self.nodes:
            try:
                self.remove(self.nodes[-1])
            finally:
                self._close_nodes()


def run_nodes(
    factories: Sequence[Callable[[NodeContext], EndoscopeNode]], args: Sequence[str] | None = None
) -> int:
    """Run nodes until a signal stops them; 0, what a node asked for, or 2 for refused arguments."""

    def compose(runtime: Runtime) -> None:
        for factory in factories:
            runtime.add(factory)

    return run(compose, args)


def run(compose: Callable[[Runtime], None], args: Sequence[str] | None = None) -> int:
    """Let ``compose`` add nodes to a runtime and run them; see :func:`run_nodes`."""
    try:
        runtime = Runtime(args)
        # The signals outermost: they are heard until the last node is closed.
        with StopSignals(runtime.stop), runtime:
            compose(runtime)
            runtime.prepare(whole_process=True)
            Announcement(runtime.nodes, runtime.process_parameters)
            runtime.spin()
    except (
        ParameterError,
        InvalidNodeNameException,
        InvalidNamespaceException,
        InvalidParameterTypeException,
    ) as error:
        print(error, file=sys.stderr)
        return 2
    return runtime.exit_code


class Announcement:
    """Says once that all nodes have found each other and wait for nothing, and what is next."""

    def __init__(
        self, nodes: Sequence[EndoscopeNode], process_parameters: Mapping[str, object]
    ) -> None:
        self._nodes = nodes
        self._looks = 0
        self._logger = nodes[0].get_logger() if len(nodes) == 1 else get_logger('graph')
        for node in nodes:
            given = {**process_parameters, **node.given} if node is nodes[0] else node.given
            set_to = [f'{name}:={as_typed(value)}' for name, value in given.items()]
            if set_to:
                node.get_logger().info(with_final_names(f'with {", ".join(set_to)}'))
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
        what = '; '.join(filter(None, (node.announcement for node in nodes)))
        return f'ready in {nodes[0].get_namespace()} {pace}' + (f': {what}' if what else '')
