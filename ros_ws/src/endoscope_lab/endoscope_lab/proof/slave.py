"""The proof on the running slave: recorded through the whole graph, and compensated afterwards."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import JointStateSeries, open_bag
from endoscope_bringup.demo.live_graph import LiveGraph
from endoscope_core.control.iterated_inverse import iterated_inverse
from endoscope_core.physics import PlantDescription, save_plant
from endoscope_core.physics.simulator import TICK
from endoscope_core.signals.command_file import write_command_file
from endoscope_core.signals.motions import motion_by_name
from endoscope_nodes.names import JOINTS, MASTER_NODE, SLAVE_COMMAND, SLAVE_MEASURED

Array = NDArray[np.float64]

EXPLAINED, JUDGED, TRACKED = 'commissioning', 'non_periodic', 'periodic'
"""Motions of the master: that is explained, that the plants are judged on, that is compensated."""
REST_S = 1.0
"""After a motion."""
SMALLER, SLOWER = 0.4, 2.0
"""Factors on size and time of the tracked motion, 60 deg: its inverse would go beyond what the
console plays, and jump by more at each reversal than it lets pass."""
LATEST_S = 4.0
"""Before a file, the master goes to its first angle."""


@dataclass(frozen=True)
class Tracking:
    """How the tip follows a motion under a command that was planned with a plant."""

    time: Array  # (N,), s
    desired: Array  # (N, J), rad
    measured: Array  # (N, J), rad

    @property
    def rmse(self) -> float:
        """In rad, over both joints."""
        return float(np.sqrt(np.mean((self.measured - self.desired) ** 2)))


def record(plant: PlantDescription, motion: str, bag: Path, seed: int) -> None:
    """Record a motion of the master, played on the slave that a plant describes."""

    def play(graph: LiveGraph) -> None:
        graph.set(MASTER_NODE, source='motion', motion=motion, joints=list(JOINTS))
        graph.advance(motion_by_name(motion).duration + REST_S)

    _played(plant, bag, seed, play)


def tracked(slave: PlantDescription, known: PlantDescription, folder: Path, seed: int) -> Tracking:
    """Move the slave by the inverse of the plant that is known; `folder` is made here."""
    folder.mkdir()
    motion = motion_by_name(TRACKED)
    time = np.arange(0.0, SLOWER * motion.duration, TICK)
    desired, speed = (SMALLER * values for values in motion.sample(time / SLOWER))
    speed /= SLOWER
    planned = iterated_inverse(known, desired, speed)
    file = folder / 'command.csv'
    write_command_file(file, time, planned.command, JOINTS)

    def play(graph: LiveGraph) -> None:
        # What is asked for is a command, which nothing else may correct.
        graph.set('compensator', mode='none')
        graph.set('controller', active=False)
        graph.set(MASTER_NODE, command_file=str(file), source='file')
        graph.advance(SLOWER * motion.duration + LATEST_S + REST_S)

    _played(slave, folder / 'recording', seed, play)
    bag = open_bag(folder / 'recording')
    measured = bag.joint_state(SLAVE_MEASURED)
    since = (measured.stamp_ns - _begin_ns(bag.joint_state(SLAVE_COMMAND), planned.command)) * 1e-9
    moved = (since >= 0.0) & (since <= time[-1])
    angles = measured.select(JOINTS).require('position')[moved]
    wanted = [np.interp(since[moved], time, desired[:, j]) for j in range(len(JOINTS))]
    return Tracking(since[moved], np.stack(wanted, axis=1), angles)


def _begin_ns(asked: JointStateSeries, command: Array) -> int:
    """When the master, on its way to the first angle of a command (N, J) at first, began it."""
    position = asked.select(JOINTS).require('position')
    since = (asked.stamp_ns - asked.stamp_ns[0]) * 1e-9

    def off(begin: float) -> float:
        ticks = np.rint((since - begin) / TICK).astype(np.int64)
        inside = (ticks >= 0) & (ticks < len(command))
        return float(np.mean((position[inside] - command[ticks[inside]]) ** 2))

    begins = np.arange(0.0, LATEST_S, TICK)
    return int(asked.stamp_ns[0] + 1e9 * min(begins, key=off))


def _played(
    plant: PlantDescription, bag: Path, seed: int, play: Callable[[LiveGraph], None]
) -> None:
    # Where nobody who explains looks.
    with TemporaryDirectory() as hidden:
        file = Path(hidden) / 'slave.yaml'
        save_plant(plant, file)
        overrides: dict[str, dict[str, object]] = {
            'motor_driver': {'seed': seed, 'plant_file': str(file)}
        }
        with LiveGraph(bag, lock_step=True, overrides=overrides) as graph:
            graph.client.ask('enable')
            play(graph)
            graph.set(MASTER_NODE, source='none')
            graph.advance(REST_S)
            graph.stop()
