"""The proof on the running slave: recorded by the whole graph, then compensated."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from endoscope_bringup.demo.live_graph import LiveGraph
from endoscope_core.physics import PlantDescription, save_plant
from endoscope_core.physics.plant_file import plant_as_text
from endoscope_core.signals.motions import motion_by_name
from endoscope_core.signals.sampled_motion import write_command_file
from endoscope_explain.investigation.motions import Tracked
from endoscope_explain.investigation.motions import tracked as tracked_of
from endoscope_nodes.client.plant_adoption import AdoptedPlants
from endoscope_nodes.names import JOINTS, MASTER_NODE

EXPLAINED, JUDGED, TRACKED = 'commissioning', 'non_periodic', 'periodic'
"""Motions of the master: to explain, to judge the plants on, and to track with compensation."""
REST_S = 1.0
"""Rest after a motion."""
SMALLER = 0.4
"""Factor on the amplitude of the tracked motion, 60 deg, so that every drawn plant reaches it."""
SAMPLE_S = 0.01
LATEST_S = 4.0
"""Longest time in which the master goes to the first angle of a file."""


def record(plant: PlantDescription, motion: str, bag: Path, seed: int) -> None:
    """Record a motion of the master on the slave that a plant describes."""

    def play(graph: LiveGraph) -> None:
        graph.set(MASTER_NODE, source='motion', motion=motion, joints=list(JOINTS))
        graph.advance(motion_by_name(motion).duration + REST_S)

    _played(plant, bag, seed, play)


def tracked(slave: PlantDescription, known: PlantDescription, folder: Path, seed: int) -> Tracked:
    """Track a motion with the inverse of the `known` plant; creates `folder`.

    RefusedAdoptionError if the compensator refuses that plant.
    """
    folder.mkdir()
    motion = motion_by_name(TRACKED)
    time = np.arange(0.0, motion.duration, SAMPLE_S)
    file = folder / 'desired.csv'
    write_command_file(file, time, SMALLER * motion.sample(time)[0], JOINTS)

    def play(graph: LiveGraph) -> None:
        # Only the inverse of the plant is judged, without feedback.
        graph.set('controller', active=False)
        AdoptedPlants(graph.client).adopt(plant_as_text(known))
        graph.set(MASTER_NODE, command_file=str(file), source='file')
        graph.advance(motion.duration + LATEST_S + REST_S)

    _played(slave, folder / 'recording', seed, play)
    return tracked_of(folder / 'recording', file)


def _played(
    plant: PlantDescription, bag: Path, seed: int, play: Callable[[LiveGraph], None]
) -> None:
    # In a folder that the explanation does not read.
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
