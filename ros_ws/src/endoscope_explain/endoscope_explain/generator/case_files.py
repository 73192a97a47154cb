"""A drawn case on disk: its bags, the plant an engineer would have, and the sealed truth."""

import json
from pathlib import Path

from endoscope_explain.generator.case_draw import Case
from endoscope_explain.generator.joint_state_bag import write_streams

PLANT_FILE = 'plant.yaml'
PLANT_TEXT = 'joints:\n  bend_x: {}\n  bend_y: {}\neffects: []\n'


def write_case(case: Case, folder: str | Path) -> Path:
    """Write `NAME.mcap`, `NAME.second.mcap`, ..., `plant.yaml` and `NAME.truth.json`.

    Returns
    -------
    Path
        The first recording.

    Raises
    ------
    FileExistsError
        A recording of this name is there already.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    truth = folder / f'{case.name}.truth.json'
    if truth.exists():
        raise FileExistsError(f'{truth} exists already: choose another folder or seed')
    for suffix, streams in case.recordings.items():
        name = f'{case.name}.{suffix}.mcap' if suffix else f'{case.name}.mcap'
        write_streams(folder / name, streams)
    (folder / PLANT_FILE).write_text(PLANT_TEXT)
    truth.write_text(json.dumps(case.truth, indent=1) + '\n')
    return folder / f'{case.name}.mcap'
