"""Rigs of the simulator that shares no code with the kernel, with a law of another form or none."""

from collections.abc import Callable
from dataclasses import asdict
from functools import partial

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics import JointParameters
from endoscope_core.physics.plant_file import plant_to_mapping
from endoscope_lab.concealed import motions
from endoscope_lab.concealed.another_rig import FEW_NODES, FORMS, Laws, drawn_laws, read
from endoscope_lab.concealed.judge import Case, Law, law_of_effect
from endoscope_lab.concealed.readings import Readings, as_sensed
from endoscope_lab.concealed.rigs import described_rig, true_rig
from endoscope_lab.concealed.strength import AIM, drawn_as_strong

Array = NDArray[np.float64]
Generator = np.random.Generator

NOTHING = 1.0 / 6.0
"""Share of the rigs without an injected law."""


def of_other_simulator(
    generator: Generator, effect: str | None, aims: tuple[float, float] = AIM
) -> tuple[Case, dict]:
    """A rig of sliding nodes, with a given or drawn effect that moves a share of the signal."""
    described = described_rig(generator, 1)
    true = true_rig(generator, described)
    (name, joint), sensors = *true.joints.items(), true.sensors
    command = motions.commissioning(generator, 1)
    second = motions.another(generator, 1)
    laws, share, concealed = Laws(), 0.0, tuple[Law, ...]()
    if effect is not None or generator.random() >= NOTHING:
        effect = effect or str(generator.choice(list(FORMS)))
        laws, share = _as_strong(generator, effect, joint, command, aims)
        concealed = (law_of_effect(effect, name),)
    noise = int(generator.integers(2**31))
    recording, other = (
        as_sensed(read(joint, laws, each), (name,), sensors, noise + k)
        for k, each in enumerate((command, second))
    )
    case = Case('', 0, described, true, true, concealed, recording, other, moved=share)
    numbers = {key: value for key, value in asdict(laws).items() if value != getattr(Laws(), key)}
    words = FORMS[effect].words if effect else ''
    truth = {'concealed': [law.name for law in concealed], 'words': words, 'laws': numbers}
    return case, truth | plant_to_mapping(true)


def _as_strong(
    generator: Generator,
    effect: str,
    joint: JointParameters,
    command: Array,
    aims: tuple[float, float],
) -> tuple[Laws, float]:
    """A law that moves a drawn share of the signal, drawn again if it cannot."""
    bare = read(joint, Laws(), command, FEW_NODES)
    reached, duration = float(np.abs(bare.bending).max()), float(bare.time[-1])

    def draw() -> tuple[Callable[[float], Laws], Callable[[float], Readings], float]:
        laws = drawn_laws(generator, effect, duration, reached)
        return laws, partial(_roughly, joint, laws, command), 1.0

    laws, strength, share = drawn_as_strong(generator, aims, draw)
    return laws(strength), share


def _roughly(
    joint: JointParameters, laws: Callable[[float], Laws], command: Array, strength: float
) -> Readings:
    return read(joint, laws(strength), command, FEW_NODES)
