"""What the nodes of a process share, and what each is given when it is made."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future

from endoscope_core.errors import FileError
from endoscope_core.physics import PlantDescription, load_plant
from endoscope_core.physics.effect import Stage
from endoscope_core.physics.effects import describe
from endoscope_core.physics.plant_file import plant_from_mapping
from endoscope_core.rig import Rig, load_rig
from endoscope_core.schema import parse_yaml
from endoscope_nodes.names import CLOCK, CLOCK_NODE, JOINTS
from endoscope_nodes.runtime.declared_parameters import (
    check_sections,
    declare_parameters,
    given_to_nodes,
)
from endoscope_nodes.runtime.environment import bare_node
from endoscope_nodes.runtime.measured_pose import MeasuredPose
from endoscope_nodes.runtime.node_parameters import BeatParameters, RealTimeParameters
from endoscope_nodes.runtime.parameters import ParameterError, changed
from endoscope_nodes.runtime.ticker import Ticker

NAMESPACE = 'endoscope'


def adopted_plant(text: str) -> PlantDescription | None:
    """Read a plant that a compensator has in force; None for no text, FileError for no plant."""
    return plant_from_mapping(parse_yaml(text, 'the adopted plant')) if text else None


def load_slave(source: str, path: str) -> PlantDescription:
    """Load a plant file of both joints that `source` names; an empty path is the nominal plant."""
    if not path:
        return PlantDescription()
    try:
        plant = load_plant(path)
    except (FileError, OSError) as error:
        raise ParameterError(f'{source}: {error}') from error
    if plant.joint_names() != JOINTS:
        raise ParameterError(
            f'{source}: {path} describes {", ".join(plant.joints)}; '
            f'the nodes need {", ".join(JOINTS)} in this order'
        )
    for spec in plant.effects:
        if describe(spec.id).stage is Stage.RECORDING:
            raise ParameterError(
                f'{source}: {path} has the effect {spec.id}, which acts '
                'on recordings: leave it out here, and let `endoscope simulate` apply it'
            )
    return plant


def all_matched(nodes: Sequence[Node]) -> bool:
    """Say whether no message between these nodes would be lost from now on.

    Both sides have to know of each other. A node that reads topics past its subscriptions lists
    them in ``extra_readers() -> [(topic, publishers found)]``.
    """
    here = {(node.get_name(), node.get_namespace()) for node in nodes}
    for node in nodes:
        for publisher in node.publishers:
            known = node.get_subscriptions_info_by_topic(publisher.topic_name)
            wanted = sum((info.node_name, info.node_namespace) in here for info in known)
            if publisher.get_subscription_count() < wanted:
                return False
        readers = [(s.topic_name, s.get_publisher_count()) for s in node.subscriptions]
        if hasattr(node, 'extra_readers'):
            readers += node.extra_readers()
        for topic, found in readers:
            known = node.get_publishers_info_by_topic(topic)
            if found < sum((info.node_name, info.node_namespace) in here for info in known):
                return False
    return True


class NodeContext:
    """Rig, ticker, measured pose and parameter overrides of a process, for its nodes."""

    def __init__(
        self,
        context: Context,
        args: Sequence[str],
        overrides: Mapping[str, Mapping[str, object]] | None,
        rig: Rig | None,
    ) -> None:
        self.context = context
        self.nodes: Sequence[Node] = []
        self._args = list(args)
        self._ticker: Ticker | None = None
        self._pose: MeasuredPose | None = None
        self._asked_pose: list[Node] = []
        self._rig = rig
        self._plant: PlantDescription | None = None
        self._plant_source = '', ''
        self._seed = 0
        self.process_parameters: dict[str, object] = {}  # of the whole process, not the defaults
        self._real_time = RealTimeParameters()
        self._overrides = overrides or {}
        # The simulation clock's, in a lock-step that nobody has asked for.
        self.chosen: dict[str, object] = {}
        self.clock = CLOCK  # topic of the simulated time
        self._stop = Future()

    def given(self, name: str) -> dict[str, object]:
        """Parameter values that the command line has for a node of this name."""
        with bare_node(name, NAMESPACE, self.context) as node:
            # rclpy has no public way to what the command line gave.
            given = node._parameter_overrides  # noqa: SLF001
            values = {key: value.value for key, value in given.items()}
            return values | given_to_nodes(self._args).get(name, {})

    def value_given(self, name: str, parameter: str) -> object:
        """Value that this process was asked to give a node's parameter; None for none."""
        return {**self.given(name), **self._overrides.get(name, {})}.get(parameter)

    def keep_lock_step(self, clock: Mapping[str, object]) -> None:
        """Simulate time though nobody has asked for it; call it before the first node is added."""
        self.chosen = {**clock, **self.given(CLOCK_NODE)}
        with bare_node(CLOCK_NODE, NAMESPACE, self.context) as node:
            # Two rigs of a domain do not share a clock.
            if node.get_namespace() != f'/{NAMESPACE}':
                self.clock = CLOCK.strip('/')

    def overrides_of(self, name: str) -> list[Parameter]:
        """Parameter values that this process was asked to give the node called ``name``."""
        values: dict[str, object] = {'use_sim_time': True} if self.chosen else {}
        values |= self.chosen if name == CLOCK_NODE else {}
        values |= given_to_nodes(self._args).get(name, {})
        values |= self._overrides.get(name, {})
        return [Parameter(key, value=value) for key, value in values.items()]

    def ticker_of(self, node: Node) -> Ticker:
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
            node._time_source.detach_node()  # noqa: SLF001
        return self._ticker

    def pose_of(self, node: Node) -> MeasuredPose:
        """Give the process's view of where the slave is; a node that asks for it hosts it."""
        if self._pose is None:
            self._pose = MeasuredPose(node, self.ticker, self.rig)
        self._asked_pose.append(node)
        return self._pose

    def _stride_and_rig(self, node: Node) -> int:
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

    @property
    def plant_name(self) -> str:
        """File name of the simulated slave's plant; `nominal` where there is no file."""
        return Path(self._plant_source[1]).name or 'nominal'

    def seed_of(self, device: int) -> int:
        """Seed of the noise of a simulated device; each has its own number."""
        return self._seed + device

    @property
    def ticker(self) -> Ticker:
        """The ticker of this process; there is one once a node has been added."""
        if self._ticker is None:
            raise RuntimeError('no node has been added yet')
        return self._ticker

    def _leave_pose(self, node: Node) -> None:
        self._asked_pose = [other for other in self._asked_pose if other is not node]
        if self._pose is not None and self._pose.host is node:
            if self._asked_pose:
                self._pose.listen(self._asked_pose[0])
            else:
                self._pose = None

    def connected(self) -> bool:
        """Whether the nodes of this process have found each other's topics."""
        return all_matched(self.nodes)

    def stop(self) -> None:
        """Let the process end; may be called from any thread, before or while it spins."""
        if not self._stop.done():
            self._stop.set_result(None)
