"""`simulate` and `explain`: the commands of these names, with results in memory."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, overload

from numpy.typing import ArrayLike

from endoscope_bags import open_bag
from endoscope_core.atomic_output import atomic_directory
from endoscope_core.errors import FileError, InputError
from endoscope_core.physics import PlantDescription, load_plant, recording_faults
from endoscope_core.physics.packing import pack
from endoscope_core.rig import Rig, load_rig
from endoscope_explain.answer_bag import write_answer
from endoscope_explain.case import ExplainedCase, Sources
from endoscope_explain.explanation import NominalEstimate
from endoscope_explain.many_bags import explained_cases
from endoscope_explain.notebook.arguments import SCRATCH, checked, takes
from endoscope_explain.notebook.signals import Signals, commands_from, read
from endoscope_explain.options import Options
from endoscope_explain.pipeline import Progress
from endoscope_explain.report.sentences import terminal_text
from endoscope_explain.report.writing import report_mapping, write_report

Plant = str | Path | PlantDescription
Bag = str | Path | Signals
Seconds = Bag | Sequence[Bag | None] | None
RigGiven = str | Path | Rig | None


class Explained(ExplainedCase):
    """An explained recording; prints itself as the command does.

    Its `verdict` is a word of `report.json`, its `effects` are what the simulation left out, most
    certain first, its `plant` is the improved one, which `simulate` takes; it took `runtime_s` s.
    """

    @property
    def parameters(self) -> Mapping[str, Mapping[str, NominalEstimate]]:
        """Refitted parameters of the plant, by joint and name."""
        return self.explanation.parameters

    @cached_property
    def report(self) -> dict[str, Any]:
        """What `report.json` contains."""
        return report_mapping(self)

    def save(self, folder: str | Path) -> Path:
        """Write report.json, report.html and plant.yaml to a new or empty folder; return it.

        Raises
        ------
        OutputError
            There is something in it.
        """
        with atomic_directory(folder) as partial:
            write_report(self, partial)
        return Path(folder)

    def __repr__(self) -> str:
        return f'{self.recording.name}: {self.verdict}. {terminal_text(self)}'


@checked
def simulate(
    plant: Plant,
    commands: Bag | Mapping[str, ArrayLike],
    *,
    noise: int | None = None,
    out: str | Path | None = None,
    rig: RigGiven = None,
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
        A rig.yaml, or what it describes; the rig that the bag names by default, or as shipped.

    Returns
    -------
    Signals
        What the sensors would read, as `read` gives it.

    Raises
    ------
    EndoscopeError
        The plant or the commands cannot be used, or `out` exists.
    """
    if noise is not None and noise < 0:
        raise InputError(f'noise is {noise}: give a seed of 0 or above')
    scratch = tempfile.TemporaryDirectory(prefix=SCRATCH)
    if isinstance(commands, Mapping) and not isinstance(commands, Signals):
        commands = commands_from(commands)
    target = Path(scratch.name) / 'simulated.mcap' if out is None else Path(out)
    write_answer(_plant(plant), open_bag(_path(commands)), target, noise, _rig(rig))
    return replace(read(target), _kept=scratch)


@overload
def explain(bag: Bag, plant: Plant, **options: Any) -> Explained: ...
@overload
def explain(bag: Sequence[Bag], plant: Plant, **options: Any) -> list[Explained]: ...


# The overloads separate one result from several, and leave the options to the signature below.
@takes(Options, {'baseline': Bag | None, 'validate': Seconds, 'rig': RigGiven})
def explain(
    bag: Bag | Sequence[Bag],
    plant: Plant,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> Explained | list[Explained]:
    """Explain where recordings and their simulation differ, and what was left out.

    Parameters
    ----------
    bag : str, Path or Signals, or a sequence of them
        The recording; or several, which are explained side by side.
    plant : str, Path or PlantDescription
        The simulation that is to be compared.
    progress : callable, optional
        Called with a few words on what is being done, such as `print`.
    **options
        As of the command.

    Returns
    -------
    Explained, or a list of them
        Of each recording in its order where several were given.

    Raises
    ------
    EndoscopeError
        A recording, the plant or an option cannot be used.
    """
    alone = isinstance(bag, Bag)
    bags = [bag] if isinstance(bag, Bag) else list(bag)
    validate = options['validate']
    seconds = [validate] * len(bags) if isinstance(validate, Bag | None) else list(validate)
    if not bags or len(seconds) != len(bags):
        raise InputError(
            f'{len(bags)} recordings with {len(seconds)} in validate: give one or more, and as '
            'many in validate'
        )
    described = _plant(plant)
    options |= {'rig': _rig(options['rig']), 'baseline': _path_if(options['baseline'])}
    file = None if isinstance(plant, PlantDescription) else Path(plant)
    sources = [
        Sources(_path(one), described, plant_file=file, **options | {'validate': _path_if(second)})
        for one, second in zip(bags, seconds, strict=True)
    ]
    cases = explained_cases(sources, progress)
    found = [Explained(**vars(case)) for case in cases]
    return found[0] if alone else found


def _plant(plant: Plant) -> PlantDescription:
    if not isinstance(plant, PlantDescription):
        return load_plant(plant)
    try:
        # What a plant.yaml could not describe is refused before a recording is read.
        pack(plant)
        recording_faults(plant)
    except ValueError as error:
        raise FileError(f'the plant: {error}') from error
    return plant


def _rig(rig: RigGiven) -> Rig | None:
    return load_rig(rig) if isinstance(rig, str | Path) else rig


def _path(bag: Bag) -> Path:
    return bag.path if isinstance(bag, Signals) else Path(bag)


def _path_if(bag: Bag | None) -> Path | None:
    return None if bag is None else _path(bag)
