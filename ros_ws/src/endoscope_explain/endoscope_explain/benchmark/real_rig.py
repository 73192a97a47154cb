"""A real rig in several shapes of its tube: explained from the first cycle, judged on the second.

The recordings (see `endoscope_core.trials.real_recordings`) do not come with this project. What is
not written in them is the rig's geometry, and it was chosen by the first cycle: a pulley of three
times the joint's radius, and an angle that is that of the tip's chord, which for a section bent to
an arc is half of the bending angle.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_bags.table_mapping import UNITS, Column, TableMapping
from endoscope_bags.text_table import convert_table
from endoscope_core.effects import CATALOGUE
from endoscope_core.effects.slots import NOMINAL_KEYS
from endoscope_core.plant import PlantDescription, SensorParameters
from endoscope_core.plant.parameters import JointParameters
from endoscope_core.trials.real_recordings import CYCLE_S, RealRecording, fit_first_cycle
from endoscope_explain.anchoring import anchored
from endoscope_explain.fit import Fit, JointModel
from endoscope_explain.given_physics import GivenPhysics
from endoscope_explain.held_noise import with_held_noise
from endoscope_explain.many_bags import explain_one, physics_of_all
from endoscope_explain.observation import JointObservation, observe
from endoscope_explain.pipeline import Sources, read_inputs
from endoscope_explain.recording import Recording
from endoscope_explain.recording.series import MOTOR

Array = NDArray[np.float64]

JOINT = 'bend_x'
ARC = 2.0
"""Bending angle of an arc by the angle of its chord."""
PLANT = PlantDescription(
    joints={JOINT: JointParameters(pulley_radius=0.0075)},
    sensors=SensorParameters(load_cell_noise=0.17, tracker_noise=0.005 * ARC),
)
"""How far the form of the plant can be trusted stands for the noise of its sensors: what the
explained plant leaves of the first cycle, so that tensions and angle count alike."""
BAND = 30.0
"""Nothing is known of the rig's numbers: they may differ by so much from the nominal ones."""
EFFECTS = 6
MODELS = ('bouc_wen', 'asymmetric_bouc_wen', 'prandtl_ishlinskii')
TABLE = TableMapping(
    Column(1, 1.0, 0.0),
    {
        'motor/servo_jp': {'position': {'motor_x': Column(2, UNITS['deg'], 0.0)}},
        'slave/measured_js': {'position': {JOINT: Column(4, ARC * UNITS['deg'], 0.0)}},
        'wires/measured_js': {
            'effort': {'wire_x_pos': Column(5, 1.0, 0.0), 'wire_x_neg': Column(6, 1.0, 0.0)}
        },
    },
    sample_and_hold=True,
)


@dataclass(frozen=True)
class Misfit:
    """RMS of what a model leaves of the second cycle.

    Attributes
    ----------
    angle : float
        rad, as measured.
    tensions : tuple of float
        N, of each wire.
    """

    angle: float
    tensions: tuple[float, ...]


@dataclass(frozen=True)
class RealTube:
    """One shape of the tube.

    Attributes
    ----------
    name : str
    verdict : str
    effects : tuple of str
        Named, most certain first.
    refitted, explained : Misfit
        Of the nominal plant with the best numbers, and with the physics that was left out.
    models : mapping of str to float
        RMS in rad of models of the angle alone.
    numbers : mapping of str to float
        Parameters of the explained plant, SI; those of an effect as `effect.parameter`.
    """

    name: str
    verdict: str
    effects: tuple[str, ...]
    refitted: Misfit
    explained: Misfit
    models: Mapping[str, float]
    numbers: Mapping[str, float]


def explained_rig(
    tables: Sequence[Path], folder: Path, jobs: int, say: Callable[[str], None]
) -> list[RealTube]:
    """Explain all recordings of the rig together.

    Parameters
    ----------
    tables : sequence of Path
        Text tables, one for each shape of the tube.
    folder : Path
        Where bags are written.
    jobs : int
        Processes side by side.
    say : callable
        Told what is being done.

    Returns
    -------
    list of RealTube

    Raises
    ------
    BagError
        If a table cannot be converted or a recording cannot be used.
    """
    first, whole = zip(*(written_bags(table, folder) for table in tables), strict=True)
    sources = [source_of(bag) for bag in first]
    tubes = []
    for table, source, both, given in zip(
        tables, sources, whole, physics_of_all(sources, jobs, say), strict=True
    ):
        content = explain_one(replace(source, given=given), jobs).content()
        effects = content['effects']
        joint = given[JOINT]
        refitted, everything = _refitted(source, jobs), observed(source_of(both))[1]
        explained = JointModel(everything, joint.base, joint.flags, joint.free)
        tubes.append(
            RealTube(
                table.stem,
                str(content['verdict']),
                tuple(str(e['id']) for e in effects) if isinstance(effects, list) else (),
                _misfit(replace(refitted.model, observation=everything), refitted.theta),
                _misfit(explained, joint.theta),
                models_of_the_angle(everything),
                _numbers(explained, given[JOINT]),
            )
        )
        say(f'{table.stem}: {content["verdict"]}')
    return tubes


def written_bags(table: Path, folder: Path) -> tuple[Path, Path]:
    """Bags of the first cycle and of all that a table has."""
    lines = table.read_text(encoding='utf-8').splitlines()
    begin = float(lines[0].split(',')[0])
    cycle = [line for line in lines if float(line.split(',')[0]) - begin <= CYCLE_S]
    bags = []
    for name, rows in ((table.stem, cycle), (f'{table.stem}_whole', lines)):
        part = folder / f'{name}.txt'
        part.write_text('\n'.join(rows), encoding='utf-8')
        bags.append(folder / f'{name}.mcap')
        convert_table(part, TABLE, bags[-1])
    return bags[0], bags[1]


def models_of_the_angle(observation: JointObservation) -> dict[str, float]:
    """RMS in rad on the second cycle of models that know command and angle only.

    Parameters
    ----------
    observation : JointObservation
        Of the whole recording.

    Returns
    -------
    dict of str to float
        By model; each is fitted to the first cycle.
    """
    angle = next(c for c in observation.channels if c.quantity == 'bending')
    command = observation.inputs[0, angle.tick, 0] * PLANT.joints[JOINT].gear
    recording = RealRecording(
        0, angle.time, command, angle.value / ARC, np.zeros((len(angle.time), 2))
    )
    second = angle.time > CYCLE_S
    found = {}
    for model in MODELS:
        error = fit_first_cycle(recording, model, 1).predict(command) - recording.actual
        found[model] = float(np.sqrt(np.mean(error[second] ** 2)))
    return found


def source_of(bag: Path) -> Sources:
    """A bag of the rig, and how it is to be explained."""
    return Sources(
        bag,
        PLANT,
        without=(MOTOR,),
        quick=True,
        band=BAND,
        most_effects=EFFECTS,
        tightened=True,
    )


def observed(source: Sources) -> tuple[Recording, JointObservation]:
    """The cleaned recording of a bag, and its analysis view."""
    recording = read_inputs(source).audit.recording
    return recording, with_held_noise(observe(recording, PLANT))[0]


def _refitted(source: Sources, jobs: int) -> Fit:
    recording, observation = observed(source)
    _, ((refitted, _),) = anchored(recording, (observation,), PLANT, BAND, jobs, tightened=True)
    return refitted


def _misfit(model: JointModel, theta: Array) -> Misfit:
    observation = model.observation
    residuals = model.residuals(theta)
    left: dict[str, list[float]] = {}
    for channel, part in zip(observation.channels, observation.slices(), strict=True):
        error = (residuals[part] * channel.noise)[channel.time > CYCLE_S]
        left.setdefault(channel.quantity, []).append(float(np.sqrt(np.mean(error**2))))
    return Misfit(left['bending'][0] / ARC, tuple(left['tension']))


def _numbers(model: JointModel, joint: GivenPhysics) -> dict[str, float]:
    packed, _ = model.packed(joint.theta)
    numbers = {key: float(value) for key, value in zip(NOMINAL_KEYS, packed, strict=False)}
    for effect_id in joint.effects:
        definition = CATALOGUE[effect_id]
        for parameter, place in zip(definition.parameters, definition.places, strict=True):
            numbers[f'{effect_id}.{parameter.name}'] = float(packed[place])
    return numbers
