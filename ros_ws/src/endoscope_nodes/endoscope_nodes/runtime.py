"""The one place that starts, spins and shuts down ROS, for one node or for many in a process."""

import gc
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
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
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from endoscope_core.closed_on_exit import ClosedOnExit
from endoscope_core.errors import FileError
from endoscope_core.physics import PlantDescription
from endoscope_core.rig import Rig, load_rig
from endoscope_nodes.announcement import Announcement
from endoscope_nodes.declared_parameters import check_overrides, declare_parameters
from endoscope_nodes.discovery import DiscoveryRangeError, stay_on_this_machine
from endoscope_nodes.endoscope_node import NAMESPACE, EndoscopeNode
from endoscope_nodes.log_level import LogLevelError, log_as_asked
from endoscope_nodes.matching import all_matched
from endoscope_nodes.names import CLOCK
from endoscope_nodes.node_parameters import BeatParameters, RealTimeParameters
from endoscope_nodes.parameter_sections import check_sections
from endoscope_nodes.parameters import ParameterError, changed
from endoscope_nodes.real_time import (
    enter_real_time,
    granted_priority,
    start_in_the_background,
    threads_of_this_process,
)
from endoscope_nodes.simulated_plant import load_slave
from endoscope_nodes.stop_signals import StopSignals
from endoscope_nodes.ticker import Ticker
from endoscope_nodes.watches import MeasuredPose

# An unbounded spin of the EventsExecutor never returns in the Jazzy wheels; a bounded one does.
# Eleven days.
FOREVER_S = 1e6
SHUTDOWN_S = 2.0
SWITCH_INTERVAL_S = 5e-5
_CARRY_ON_S = 0.1
# A collection of the second generation takes most of a tick: ten times rarer than by default.
GC_THRESHOLDS = (7000, 10, 10)

N = TypeVar('N', bound=EndoscopeNode)


class Runtime(ClosedOnExit):
    """Nodes composed in one process around one executor, one ticker and one context.

    By default it takes the command line of the process, its context, the ROS domain of the
    environment, and the rig that the parameter `rig_file` of the first node names. `overrides`, by
    node name, win over the command line's. Unreadable ROS arguments raise `ParameterError`.

    Examples
    --------
    >>> with Runtime() as runtime:            # doctest: +SKIP
    ...     runtime.add(ConsoleNode)
    ...     runtime.spin()
    """

    def __init__(
        self,
        args: Sequence[str] | None = None,
        context: Context | None = None,
        domain_id: int | None = None,
        overrides: Mapping[str, Mapping[str, object]] | None = None,
        rig: Rig | None = None,
    ) -> None:
        self.context = rclpy.get_default_context() if context is None else context
        stay_on_this_machine()
        log_as_asked()
        self._background_threads = threads_of_this_process()
        self._args = list(sys.argv[1:] if args is None else args)
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
        self._ticker: Ticker | None = None
        self._pose: MeasuredPose | None = None
        self._asked_pose: list[EndoscopeNode] = []
        self._rig = rig
        self._plant: PlantDescription | None = None
        self._plant_source = '', ''
        self._seed = 0
        self.process_parameters: dict[str, object] = {}  # of the whole process, not the defaults
        self._real_time = RealTimeParameters()
        self._overrides = overrides or {}
        # The conductor's, in a lock-step that nobody has asked for.
        self.chosen: dict[str, object] = {}
        self.clock = CLOCK  # topic of the simulated time
        self._exit_codes: list[int] = []
        self._stop = Future()
        self._closed = False

    def add(self, factory: Callable[['Runtime'], N]) -> N:
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

    def _leave_pose(self, node: EndoscopeNode) -> None:
        self._asked_pose = [other for other in self._asked_pose if other is not node]
        if self._pose is not None and self._pose.host is node:
            if self._asked_pose:
                self._pose.listen(self._asked_pose[0])
            else:
                self._pose = None

    def given(self, name: str) -> dict[str, object]:
        """Parameter values that the command line has for a node of this name."""
        with self._asked(name) as node:
            return {key: value.value for key, value in node._parameter_overrides.items()}

    @contextmanager
    def _asked(self, name: str) -> Iterator[Node]:
        node = Node(
            name,
            context=self.context,
            namespace=NAMESPACE,
            enable_rosout=False,
            start_parameter_services=False,
        )
        try:
            yield node
        finally:
            node.destroy_node()

    def keep_lock_step(self, conductor: Mapping[str, object]) -> None:
        """Simulate time though nobody has asked for it; call it before the first node is added."""
        self.chosen = {**conductor, **self.given('conductor')}
        with self._asked('conductor') as node:
            # Two rigs of a domain do not share a clock.
            if node.get_namespace() != f'/{NAMESPACE}':
                self.clock = CLOCK.strip('/')

    def overrides_of(self, name: str) -> list[Parameter]:
        """Parameter values that this process was told to give the node called ``name``."""
        values: dict[str, object] = {'use_sim_time': True} if self.chosen else {}
        values |= self.chosen if name == 'conductor' else {}
        values |= self._overrides.get(name, {})
        return [Parameter(key, value=value) for key, value in values.items()]

    def ticker_of(self, node: EndoscopeNode) -> Ticker:
        """Give the process's ticker; the first node to ask decides whether time is simulated."""
        simulated = node.get_parameter('use_sim_time').value is True
        if self._ticker is None:
            for line in check_sections(self._args, node.get_namespace()):
                node.get_logger().warning(line)
            self._ticker = Ticker(node, simulated, self._stride_and_rig(node), self.clock)
        if self._ticker.simulated != simulated:
            raise ParameterError(
                f"{node.get_name()}: parameter 'use_sim_time' differs from that "
                'of the other nodes in this process; give all the same'
            )
        if simulated:
            # rclpy would subscribe each node to /clock, at the price of a node's own work.
            node._time_source.detach_node()
        return self._ticker

    def pose_of(self, node: EndoscopeNode) -> MeasuredPose:
        """Give the process's view of where the slave is; a node that asks for it hosts it."""
        if self._pose is None:
            self._pose = MeasuredPose(node)
        self._asked_pose.append(node)
        return self._pose

    def _stride_and_rig(self, node: EndoscopeNode) -> int:
        self._real_time = declare_parameters(node, RealTimeParameters)
        given = declare_parameters(node, BeatParameters)
        self.process_parameters = changed(given) | changed(self._real_time)
        rate = given.tick_rate
        if 1000 % rate:
            raise ParameterError(
                f"{node.get_name()}: parameter 'tick_rate' is {rate}; give a rate that divides 1000"
            )
        if self._rig is None:
            try:
                self._rig = load_rig(given.rig_file or None)
            except FileError as error:
                raise ParameterError(f"{node.get_name()}: parameter 'rig_file': {error}") from error
        simulation = self._rig.simulation
        self._plant_source = (
            (f"{node.get_name()}: parameter 'plant_file'", given.plant_file)
            if given.plant_file
            else (f'rig file {given.rig_file}: simulation.plant', simulation.plant)
        )
        self._seed = simulation.seed if given.seed < 0 else given.seed
        return 1000 // rate

    @property
    def rig(self) -> Rig:
        """What stands on the table; it is known once a node has been added."""
        if self._rig is None:
            raise RuntimeError('no node has been added yet')
        return self._rig

    @property
    def plant(self) -> PlantDescription:
        """The simulated slave, read when it is asked for first."""
        if self._plant is None:
            self._plant = load_slave(*self._plant_source)
        return self._plant

    def seed_of(self, device: int) -> int:
        """Seed of the noise of a simulated device; each has its own number."""
        return self._seed + device

    @property
    def ticker(self) -> Ticker:
        """The ticker of this process; there is one once a node has been added."""
        if self._ticker is None:
            raise RuntimeError('no node has been added yet')
        return self._ticker

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

    def connected(self) -> bool:
        """Whether the nodes of this process have found each other's topics."""
        return all_matched(self.nodes)

    def stop(self) -> None:
        """Let :meth:`spin` return; may be called from any thread, before or while it spins."""
        if not self._stop.done():
            self._stop.set_result(None)

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
    factories: Sequence[Callable[[Runtime], EndoscopeNode]], args: Sequence[str] | None = None
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
            Announcement(runtime)
            runtime.spin()
    except (
        ParameterError,
        DiscoveryRangeError,
        LogLevelError,
        InvalidNodeNameException,
        InvalidNamespaceException,
        InvalidParameterTypeException,
    ) as error:
        print(error, file=sys.stderr)
        return 2
    return runtime.exit_code
