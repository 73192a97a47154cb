"""`simulate` and `explain`: the commands of these names, with results in memory."""

import tempfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, overload

from numpy.typing import ArrayLike

from endoscope_bags import open_bag
from endoscope_core.choices import WAIVABLE
from endoscope_core.errors import FileError, InputError, nearest
from endoscope_core.physics import PlantDescription, load_plant, recording_faults
from endoscope_core.physics.packing import pack
from endoscope_core.rig import Rig, load_rig
from endoscope_explain.answer_bag import write_answer
from endoscope_explain.fit.free_parameters import BAND
from endoscope_explain.many_bags import explained_cases
from endoscope_explain.notebook.arrays import commands_from
from endoscope_explain.notebook.explained import Explained
from endoscope_explain.notebook.signals import Signals, read
from endoscope_explain.pipeline import Progress, Sources
from endoscope_explain.search.levels import MOST_EFFECTS

Plant = str | Path | PlantDescription
Bag = str | Path | Signals
ONE = (str, Path, Mapping)
"""Is no sequence of bags; a mapping other than `Signals` is refused with a word about it."""


def simulate(
    plant: Plant,
    commands: Bag | Mapping[str, ArrayLike],
    *,
    noise: int | None = None,
    out: str | Path | None = None,
    rig: str | Path | Rig | None = None,
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
    rig : str, Path or Rig, optional
        A rig.yaml, or what it describes; what the bag says of its rig by default, or as shipped.

    Returns
    -------
    Signals
        What the sensors would read, as `read` gives it.

    Raises
    ------
    EndoscopeError
        The plant or the commands cannot be used, or `out` exists.
    """
    scratch = tempfile.TemporaryDirectory(prefix='endoscope-')
    if isinstance(commands, Mapping) and not isinstance(commands, Signals):
        commands = commands_from(commands)
    target = Path(scratch.name) / 'simulated.mcap' if out is None else Path(out)
    write_answer(_plant(plant), open_bag(_path(commands)), target, noise, _rig(rig))
    return replace(read(target), _kept=scratch)


@overload
def explain(bag: Bag, plant: Plant, **options: Any) -> Explained: ...
@overload
def explain(bag: Sequence[Bag], plant: Plant, **options: Any) -> list[Explained]: ...


# The overloads tell one result from several, and leave the options to the signature below.
def explain(  # type: ignore[misc]
    bag: Bag | Sequence[Bag],
    plant: Plant,
    *,
    baseline: Bag | None = None,
    validate: Bag | Sequence[Bag | None] | None = None,
    without: Collection[str] = (),
    namespace: str | None = None,
    rig: str | Path | Rig | None = None,
    band: float = BAND,
    effects: int = MOST_EFFECTS,
    same_physics: bool = False,
    quick: bool = False,
    jobs: int = 2,
    progress: Progress | None = None,
) -> Explained | list[Explained]:
    """Explain where recordings and their simulation differ, and what was left out.

    Parameters
    ----------
    bag : str, Path or Signals, or a sequence of them
        The recording; or several, which are explained side by side.
    plant : str, Path or PlantDescription
        The simulation that is to be compared.
    baseline : str, Path or Signals, optional
        A healthy recording of the same rig: only what is new since is explained.
    validate : str, Path or Signals, or a sequence of them, optional
        A second recording of the same rig to judge the fit on; one for all, or one for each.
    without : collection of str
        Topics that may be missing: `motor/measured_js`.
    namespace : str, optional
        Of the rig's topics, where a bag has several rigs.
    rig : str, Path or Rig, optional
        A rig.yaml, or what it describes; what the bag says of its rig by default.
    band : float
        By which share the plant's parameters may differ from the rig's.
    effects : int
        How many effects to look for on a joint at most.
    same_physics : bool
        Whether all recordings show one rig, so that one choice of effects has to explain all.
    quick : bool
        Whether to leave out the next experiment.
    jobs : int
        Processes side by side.
    progress : callable, optional
        Told in a few words what is being done, such as `print`.

    Returns
    -------
    Explained, or a list of them
        Of each recording in its order where several were given.

    Raises
    ------
    EndoscopeError
        A recording, the plant or an option cannot be used.
    """
    for name, number in (('band', band), ('effects', effects), ('jobs', jobs)):
        if not number > 0:
            raise InputError(f'{name} is {number!r}: give a number above 0')
    for topic in without:
        if topic not in WAIVABLE:
            raise InputError(f'without {topic!r}: {nearest(topic, WAIVABLE)}')
    bags = [bag] if isinstance(bag, ONE) else list(bag)
    seconds = (
        [validate] * len(bags) if validate is None or isinstance(validate, ONE) else list(validate)
    )
    if not bags or len(seconds) != len(bags):
        raise InputError(
            f'{len(bags)} recordings with {len(seconds)} in validate: give one or more, and as '
            'many in validate'
        )
    described, described_rig = _plant(plant), _rig(rig)
    sources = [
        Sources(
            _path(one),
            described,
            None if baseline is None else _path(baseline),
            None if second is None else _path(second),
            tuple(without),
            quick,
            band,
            effects,
            namespace=namespace,
            rig=described_rig,
            plant_file=None if isinstance(plant, PlantDescription) else Path(plant),
        )
        for one, second in zip(bags, seconds, strict=True)
    ]
    cases = explained_cases(sources, jobs, same_physics=same_physics, progress=progress)
    found = [Explained(case) for case in cases]
    return found[0] if isinstance(bag, ONE) else found


def _plant(plant: Plant) -> PlantDescription:
    if not isinstance(plant, PlantDescription):
        return load_plant(plant)
    try:
        # What a plant.yaml could not say is refused before a recording is read.
        pack(plant)
        recording_faults(plant)
    except ValueError as error:
        raise FileError(f'the plant: {error}') from error
    return plant


def _rig(rig: str | Path | Rig | None) -> Rig | None:
    return load_rig(rig) if isinstance(rig, str | Path) else rig


def _path(bag: Bag) -> Path:
    if isinstance(bag, Signals):
        return bag.path
    if isinstance(bag, str | Path):
        return Path(bag)
    raise InputError(
        f'{type(bag).__name__} is not a bag: give a path, or what read or from_arrays gave'
    )
