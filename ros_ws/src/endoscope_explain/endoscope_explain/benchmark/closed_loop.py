"""What an explanation is worth in the loop: tracking on a slave with something concealed.

The slave is the rig of the concealed case, by the generator's own physics, so that no inverse has
the form of what it inverts.
"""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_core.classifier.classification import Classifier, UnseenTensionError
from endoscope_core.control import Feedforward, FeedforwardLaw
from endoscope_core.control.iterated_inverse import iterated_inverse
from endoscope_core.dataset.rig_variation import calibration_command
from endoscope_core.identification import LawParameters, parameters_for_class
from endoscope_core.plant import PlantDescription, SensorModel, load_plant
from endoscope_core.signals import Signal, calibration_motion
from endoscope_explain.explain_recording import explain_recording
from endoscope_explain.generator import draw_case, write_case
from endoscope_explain.generator.concealed_physics import TICK, move
from endoscope_explain.generator.motions import GEAR
from endoscope_explain.generator.rig import JOINTS, RIG_TYPE
from endoscope_explain.pipeline import Sources, explain_case, read_inputs

Array = NDArray[np.float64]

UNCOMPENSATED = 'no compensation'
BOUC_WEN = 'Bouc-Wen of the class'
NOMINAL = 'inverse of the plant as described'
REFITTED = 'inverse of the refitted plant'
EXPLAINED = 'inverse of the explained plant'
WAYS = (UNCOMPENSATED, BOUC_WEN, NOMINAL, REFITTED, EXPLAINED)


@dataclass(frozen=True)
class ClosedLoop:
    """One slave.

    Attributes
    ----------
    concealed, joint : str
        What was concealed, and where.
    named : tuple of str
        What the explanation named.
    errors : dict of str to float
        By `WAYS`, rmse in rad of the joint's tip in the signal's steady part.
    """

    concealed: str
    joint: str
    named: tuple[str, ...]
    errors: dict[str, float]


def run_closed_loop(
    seed: int,
    effect: str,
    signal: Signal,
    classifier: Classifier,
    sets: Mapping[int, LawParameters],
    recorded: str = 'commissioning',
) -> ClosedLoop:
    """Conceal an effect, explain a recording, and track on the same slave.

    Parameters
    ----------
    seed : int
        Chooses rig, tube, strength and noise.
    effect : str
        To conceal, of the catalogue.
    signal : Signal
        Desired angle of both joints.
    classifier : Classifier
        Of the calibration sinusoid.
    sets : mapping of int to LawParameters
        Bouc-Wen parameters by class.
    recorded : str
        Motion of the recording: `commissioning`, or `calibration`, which moves the first joint.

    Returns
    -------
    ClosedLoop
    """
    case = draw_case(seed, 'single', recorded, (effect,))
    rig = rig_of(case.truth['rig'])
    concealed = case.truth['concealed']
    assert isinstance(concealed, list)
    joint = str(concealed[0]['joint'])
    with tempfile.TemporaryDirectory() as scratch:
        bag = write_case(case, scratch)
        plant = load_plant(Path(scratch) / 'plant.yaml')
        inputs = read_inputs(Sources(bag, plant))
        explained = explain_case(inputs, explain_recording, jobs=1, extras=False)
    time = np.arange(0.0, signal.duration, TICK)
    angle, velocity = signal(time)
    desired, speed = (np.stack([v] * len(JOINTS), axis=1) for v in (angle, velocity))

    def planned(model: PlantDescription) -> Array:
        return iterated_inverse(model, desired, speed).command

    commands = {
        UNCOMPENSATED: desired,
        BOUC_WEN: _by_class(rig, plant, desired, speed, classifier, sets, seed),
        NOMINAL: planned(plant),
        REFITTED: planned(explained.explanation.refitted),
        EXPLAINED: planned(explained.plant),
    }
    steady = (time >= signal.steady[0]) & (time < signal.steady[1])
    j = JOINTS.index(joint)
    errors = {}
    for way, command in commands.items():
        tip = move(rig, GEAR * command).bending[:, j]
        errors[way] = float(np.sqrt(np.mean((tip - angle)[steady] ** 2)))
    return ClosedLoop(effect, joint, tuple(e.id for e in explained.effects), errors)


def rig_of(truth: Any) -> NDArray[np.void]:
    """The rig (2,) of a lumped case, from the numbers by joint and name in its truth."""
    rig = np.zeros(len(JOINTS), dtype=RIG_TYPE)
    for j, joint in enumerate(JOINTS):
        for name, value in truth[joint].items():
            rig[name][j] = value
    return rig


def _by_class(
    rig: NDArray[np.void],
    plant: PlantDescription,
    desired: Array,
    velocity: Array,
    classifier: Classifier,
    sets: Mapping[int, LawParameters],
    seed: int,
) -> Array:
    """Return the first paper's command: calibrate, classify, invert the class's Bouc-Wen model."""
    motion = move(rig, calibration_command(plant, calibration_motion()))
    tension = SensorModel(plant.sensors, seed).tension(motion.tension)
    try:
        class_deg = classifier.classify(tension).class_deg
    except UnseenTensionError:
        # As the nodes have it: a tube of no known class is not compensated.
        return desired
    feedforward = Feedforward(len(JOINTS))
    parameters = parameters_for_class(sets, class_deg)
    feedforward.select(FeedforwardLaw('bouc_wen', (parameters,) * len(JOINTS)))
    steps = zip(desired.tolist(), velocity.tolist(), strict=True)
    return np.array([feedforward.step(q, v, TICK) for q, v in steps])
