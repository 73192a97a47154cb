"""`simulate` and `explain`: the commands of these names, with results in memory."""

import tempfile
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from endoscope_bags import BagWriter, MessageStream, open_bag
from endoscope_bags.cdr_encoding import encode_joint_states
from endoscope_bags.message_types import JOINT_STATE
from endoscope_core.errors import EndoscopeError
from endoscope_core.physics import PlantDescription, load_plant
from endoscope_explain.fit.free_parameters import BAND
from endoscope_explain.many_bags import explained_case
from endoscope_explain.notebook.explained import Explained
from endoscope_explain.notebook.signals import Signals, read
from endoscope_explain.pipeline import Progress, Sources
from endoscope_explain.recording.series import COMMAND, DESIRED
from endoscope_explain.search.levels import MOST_EFFECTS
from endoscope_explain.simulation.answer_bag import write_answer

Plant = str | Path | PlantDescription
Bag = str | Path | Signals
TIME = 'time'


class CommandsError(EndoscopeError, ValueError):
    """Arrays that are no commands."""


def simulate(
    plant: Plant,
    commands: Bag | Mapping[str, ArrayLike],
    *,
    noise: int | None = None,
    out: str | Path | None = None,
) -> Signals:
    """Simulate the plant's answer to commands.

    Parameters
    ----------
    plant : str, Path or PlantDescription
        A plant.yaml, or what it describes.
    commands : str, Path, Signals or mapping of str to array
        A bag, whose stamps the answer has; or arrays (N,): `time` in s, which increases, and angles
        in rad, of joints (`bend_x`: the desired angle) or of motor shafts (`motor_x`).
    noise : int, optional
        Seed of the sensors' noise; without it there is none.
    out : str or Path, optional
        Where to write the answer as a bag; without it, it is kept as long as the result is.

    Raises
    ------
    EndoscopeError
        The plant or the commands cannot be used, or `out` exists.
    """
    scratch = tempfile.TemporaryDirectory(prefix='endoscope-')
    if isinstance(commands, Mapping) and not isinstance(commands, Signals):
        source = _written(commands, Path(scratch.name) / 'commands.mcap')
    else:
        source = _path(commands)
    target = Path(scratch.name) / 'simulated.mcap' if out is None else Path(out)
    write_answer(_plant(plant), open_bag(source), target, noise)
    return replace(read(target), _kept=scratch)


def explain(
    bag: Bag,
    plant: Plant,
    *,
    baseline: Bag | None = None,
    validate: Bag | None = None,
    without: Collection[str] = (),
    namespace: str | None = None,
    band: float = BAND,
    effects: int = MOST_EFFECTS,
    quick: bool = False,
    jobs: int = 2,
    progress: Progress | None = None,
) -> Explained:
    """Explain where a recording and its simulation differ, and what was left out.

    Parameters
    ----------
    bag : str, Path or Signals
        The recording.
    plant : str, Path or PlantDescription
        The simulation that is to be compared.
    baseline : str, Path or Signals, optional
        The same rig when it was well: only what is new is explained.
    validate : str, Path or Signals, optional
        A second recording of the same rig to judge the fit on.
    without : collection of str
        Topics that may be missing: `motor/measured_js`.
    namespace : str, optional
        Of the rig's topics, where a bag has several rigs.
    band : float
        By which share the plant's parameters may differ from the rig's.
    effects : int
        How many effects to look for on a joint at most.
    quick : bool
        Whether to leave out the black boxes and the next experiment.
    jobs : int
        Processes side by side.
    progress : callable, optional
        Told in a few words what is being done, such as `print`.

    Raises
    ------
    EndoscopeError
        A recording or the plant cannot be used.
    """
    sources = Sources(
        _path(bag),
        _plant(plant),
        None if baseline is None else _path(baseline),
        None if validate is None else _path(validate),
        tuple(without),
        quick,
        band,
        effects,
        namespace=namespace,
        plant_file=None if isinstance(plant, PlantDescription) else Path(plant),
    )
    return Explained(explained_case(sources, jobs, progress))


def _plant(plant: Plant) -> PlantDescription:
    return plant if isinstance(plant, PlantDescription) else load_plant(plant)


def _path(bag: Bag | Mapping[str, ArrayLike]) -> Path:
    if isinstance(bag, Signals):
        return bag.path
    if isinstance(bag, str | Path):
        return Path(bag)
    raise CommandsError(f'{type(bag).__name__} is no bag: give a path, or what was read')


def _written(commands: Mapping[str, ArrayLike], path: Path) -> Path:
    """Write arrays as a bag of commands."""
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in commands.items()}
    time = arrays.pop(TIME, np.empty(0))
    joints = list(arrays)
    motors = [name for name in joints if name.startswith('motor_')]
    if time.ndim != 1 or len(time) < 2 or not (np.diff(time) > 0.0).all() or time[0] < 0.0:
        raise CommandsError(f'{TIME}: give two or more times in s that increase from 0 or later')
    if not joints or (motors and len(motors) < len(joints)):
        raise CommandsError(
            f'{", ".join(joints) or "no joint"}: command joints (bend_x, bend_y) or motor shafts '
            '(motor_x, motor_y)'
        )
    for name, values in arrays.items():
        if values.shape != time.shape or not np.isfinite(values).all():
            raise CommandsError(
                f'{name}: give {len(time)} finite angles, one for each time, not {values.shape}'
            )
    stamps = np.round(time * 1e9).astype(np.int64)
    position = np.stack(list(arrays.values()), axis=1)
    payloads = encode_joint_states(joints, stamps, position=position)
    topic = f'/endoscope/{COMMAND if motors else DESIRED}'
    with BagWriter(path) as bag:
        bag.write_streams([MessageStream(topic, JOINT_STATE, payloads, stamps)])
    return path
