"""One recording of the simulated slave, made and explained with its own plant."""

import os
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

from endoscope_bags import open_bag
from endoscope_bags.copying import cut
from endoscope_benchmarks.own_recordings.drawing import LEAST_S, act, drawn
from endoscope_bringup.demo.live_graph import LiveGraph
from endoscope_core.errors import EndoscopeError
from endoscope_core.physics import PlantDescription, save_plant
from endoscope_explain.explanation import Verdict
from endoscope_explain.many_bags import explained_case
from endoscope_explain.pipeline import Sources
from endoscope_explain.report.sentences import verdict_sentence
from endoscope_nodes.names import JOINTS

REFUSED = 'refused'
UNNAMED = (Verdict.CONSISTENT, Verdict.PARAMETERS_DIFFER, Verdict.INSUFFICIENT_DATA, REFUSED)


@dataclass(frozen=True)
class Row:
    """What was said of one recording."""

    seed: int
    way: str  # how it was made
    length: float  # in s, once cut
    verdict: str
    sentence: str
    load: float  # of the machine while it was made
    seconds: float  # time to make and explain it

    @property
    def names_physics(self) -> bool:
        """Whether something is said to be missing or wrong, which nothing is."""
        return self.verdict not in UNNAMED


def recorded_and_explained(seed: int, folder: Path) -> Row:
    """Make the recording of a seed in a folder, where it stays, and explain it."""
    begun = time.monotonic()
    case = drawn(seed)
    home = folder / f'{seed}'
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir(parents=True)
    plant = PlantDescription(dict.fromkeys(JOINTS, case.joint))
    save_plant(plant, home / 'plant.yaml')
    overrides: dict[str, dict[str, object]] = {
        'motor_driver': {'seed': seed, 'plant_file': str(home / 'plant.yaml')},
        'calibration': {'motion': case.calibration},
    }
    ended = ''
    with LiveGraph(home / 'whole', lock_step=case.lock_step, overrides=overrides) as graph:
        try:
            act(graph, case)
        except EndoscopeError as error:
            # A busy machine, or a motion that the graph refuses: what was recorded is explained.
            ended = f'; ended by: {error}'
        graph.stop()
    load = os.getloadavg()[0]
    whole = open_bag(home / 'whole')
    length = (whole.end_ns - whole.start_ns) * 1e-9
    begin, end = case.cut[0] * length, (1.0 - case.cut[1]) * length
    if end - begin < LEAST_S:
        begin, end = 0.0, length
    cut(home / 'whole', home / 'cut', begin, end)
    shutil.rmtree(home / 'whole')
    try:
        explained = explained_case(Sources(home / 'cut', plant, quick=True))
        verdict, sentence = str(explained.verdict), verdict_sentence(explained)
    except EndoscopeError as error:
        # A stretch in which nothing was commanded.
        verdict, sentence = REFUSED, str(error)
    way = 'lock-step' if case.lock_step else 'real time'
    return Row(
        seed,
        f'{way}: {", ".join(case.actions)}{ended}',
        end - begin,
        verdict,
        sentence,
        load,
        time.monotonic() - begun,
    )
