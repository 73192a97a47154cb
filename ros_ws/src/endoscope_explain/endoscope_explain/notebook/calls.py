"""`simulate` and `explain`: the commands of these names, with results in memory."""

import tempfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, overload

from numpy.typing import ArrayLike

from endoscope_bags import open_bag
from endoscope_core.atomic_output import atomic_directory
from endoscope_core.choices import WAIVABLE
from endoscope_core.errors import FileError, InputError, nearest
from endoscope_core.physics import PlantDescription, load_plant, recording_faults
from endoscope_core.physics.packing import pack
from endoscope_core.rig import Rig, load_rig
from endoscope_explain.answer_bag import write_answer
from endoscope_explain.case import ExplainedCase
from endoscope_explain.explanation import NamedEffect, NominalEstimate
from endoscope_explain.fit.free_parameters import BAND
from endoscope_explain.many_bags import explained_cases
from endoscope_explain.notebook.arguments import SCRATCH, checked
from endoscope_explain.notebook.arrays import commands_from
from endoscope_explain.notebook.signals import Signals, read
from endoscope_explain.pipeline import Progress, Sources
from endoscope_explain.report.sentences import terminal_text
from endoscope_explain.report.writing import report_mapping, write_report
from endoscope_explain.search.levels import MOST_EFFECTS

Plant = str | Path | PlantDescription
Bag = str | Path | Signals


@dataclass(frozen=True)
class Explained:
    """An explained recording; prints itself as the command does.

    Attributes
    ----------
    case : ExplainedCase
        Everything that is known about it.
    """

    case: ExplainedCase

    @property
    def verdict(self) -> str:
        """One of the words of `report.json`, such as `missing_physics`."""
        return str(self.case.verdict)

    @property
    def effects(self) -> tuple[NamedEffect, ...]:
        """What the simulation left out, most certain first."""
        return self.case.effects

    @property
    def parameters(self) -> Mapping[str, Mapping[str, NominalEstimate]]:
        """Refitted parameters of the plant, by joint and name."""
        return self.case.explanation.parameters

    @property
    def plant(self) -> PlantDescription:
        """The improved plant, which `simulate` takes."""
        return self.case.plant

    @cached_property
    def report(self) -> dict[str, Any]:
        """What `report.json` contains."""
        return report_mapping(self.case)

    def save(self, folder: str | Path) -> Path:
        """Write report.json, report.html and plant.yaml to a new or empty folder; return it.

        Raises
        ------
        OutputError
            There is something in it.
        """
        with atomic_directory(folder) as partial:
            write_report(self.case, partial)
        return Path(folder)

    def __repr__(self) -> str:
        return f'{self.case.recording.name}: {self.verdict}. {terminal_text(self.case)}'


@checked
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
@checked  # type: ignore[misc]
def explain(
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
        A rig.yaml, or what it describes; the rig that the bag names by default.
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
    alone = isinstance(bag, Bag)
    bags = [bag] if isinstance(bag, Bag) else list(bag)
    seconds = (
        [validate] * len(bags) if validate is None or isinstance(validate, Bag) else list(validate)
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


def _rig(rig: str | Path | Rig | None) -> Rig | None:
    return load_rig(rig) if isinstance(rig, str | Path) else rig


def _path(bag: Bag) -> Path:
    return bag.path if isinstance(bag, Signals) else Path(bag)
