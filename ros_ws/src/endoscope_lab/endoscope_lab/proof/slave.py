"""The proof on the running slave: recorded through the whole graph, and compensated afterwards."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from endoscope_bringup.demo.live_graph import LiveGraph
from endoscope_core.physics import PlantDescription, save_plant
from endoscope_core.physics.plant_file import plant_as_text
from endoscope_core.signals.command_file import write_command_file
from endoscope_core.signals.motions import motion_by_name
from endoscope_explain.investigation.tracking import Tracked
from endoscope_explain.investigation.tracking import tracked as tracked_of
from endoscope_nodes.client.plant_adoption import AdoptedPlants
from endoscope_nodes.names import JOINTS, MASTER_NODE

EXPLAINED, JUDGED, TRACKED = 'commissioning', 'non_periodic', 'periodic'
"""Motions of the master: that is explained, that the plants are judged on, that is compensated."""
REST_S = 1.0
"""After a motion."""
SMALLER = 0.4
"""Factor on the size of the tracked motion, 60 deg: every plant that is drawn reaches it."""
SAMPLE_S = 0.01
LATEST_S = 4.0
"""Before a file, the master goes to its first angle."""


def record(plant: PlantDescription, motion: str, bag: Path, seed: int) -> None:
    """Record a motion of the master, played on the slave that a plant describes."""

    def play(graph: LiveGraph) -> None:
        graph.set(MASTER_NODE, source='motion', motion=motion, joints=list(JOINTS))
        graph.advance(motion_by_name(motion).duration + REST_S)

    _played(plant, bag, seed, play)


def tracked(slave: PlantDescription, known: PlantDescription, folder: Path, seed: int) -> Tracked:
    """Move the slave by the inverse of the plant that is known; `folder` is made here.

    RefusedAdoptionError if the compensator does not take that plant.
    """
    folder.mkdir()
    motion = motion_by_name(TRACKED)
    time = np.arange(0.0, motion.duration, SAMPLE_S)
    file = folder / 'desired.csv'
    write_command_file(file, time, SMALLER * motion.sample(time)[0], JOINTS)

    def play(graph: LiveGraph) -> None:
        # The plant's inverse alone is judged.
        graph.set('controller', active=False)
        AdoptedPlants(graph.client).adopt(plant_as_text(known))
        graph.set(MASTER_NODE, command_file=str(file), source='file')
        graph.advance(motion.duration + LATEST_S + REST_S)

    _played(slave, folder / 'recording', seed, play)
    return tracked_of(folder / 'recording', file)


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
