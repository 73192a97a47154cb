"""Rigs for the proof, each with something concealed in it, or with nothing."""

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from endoscope_core.errors import EndoscopeError, nearest
from endoscope_core.physics import JointParameters, PlantDescription
from endoscope_core.physics.effect import Stage
from endoscope_core.physics.effects import describe
from endoscope_core.physics.plant_file import plant_to_mapping
from endoscope_lab.concealed import motions
from endoscope_lab.concealed.forms import DRAWN
from endoscope_lab.concealed.judge import Case, Law, law_of_effect
from endoscope_lab.concealed.readings import Readings, as_sensed
from endoscope_lab.concealed.rigs import described_rig, true_rig
from endoscope_lab.concealed.strata import AIM, as_strong, drawn_case
from endoscope_lab.concealed.strength import drawn_as_strong
from endoscope_lab.proof import OTHER, SLAVE
from endoscope_lab.proof.another_rig import FEW_NODES, FORMS, Laws, drawn_laws, read
from endoscope_nodes.names import JOINTS

Array = NDArray[np.float64]
Generator = np.random.Generator

NOTHING, UNKNOWN = 1.0 / 6.0, 1.0 / 6.0
"""Shares of the rigs in which nothing is concealed, and a law that no catalogue has."""


class NoSuchEffectError(EndoscopeError, ValueError):
    """An effect that cannot be concealed."""


def require_drawn(effect: str, form: str) -> None:
    """Raise NoSuchEffectError of an effect that is not among those drawn."""
    known = list(FORMS if form == OTHER else DRAWN)
    if form == SLAVE:
        known = [each for each in known if describe(each).stage is not Stage.RECORDING]
    if effect not in known:
        raise NoSuchEffectError(
            f'--effect {effect}: with --form {form} {nearest(effect, sorted(known))}'
        )


def drawn(form: str, seed: int, number: int, effect: str | None = None) -> tuple[Case, dict]:
    """Draw a rig of `SIMULATORS` or `SLAVE` and, unless given, its effect; its truth as data."""
    generator = np.random.default_rng([seed, number])
    if form == OTHER:
        return of_other_simulator(generator, effect)
    return _of_slave(generator, effect) if form == SLAVE else _own(generator, effect)


def _of_slave(generator: Generator, effect: str | None) -> tuple[Case, dict]:
    """A rig of both joints, with what a slave that runs can have."""
    while True:
        case, truth = _own(generator, effect)
        if all(law.stage != Stage.RECORDING for law in case.laws):
            break
    alike = next(iter(case.described.joints.values()))

    def whole(plant: PlantDescription) -> PlantDescription:
        return replace(plant, joints={name: plant.joints.get(name, alike) for name in JOINTS})

    case = replace(case, described=whole(case.described), true=whole(case.true))
    return case, {'concealed': truth['concealed']} | plant_to_mapping(case.true)


def _own(generator: Generator, effect: str | None) -> tuple[Case, dict]:
    case_seed = int(generator.integers(100, 2**31))
    if effect is not None:
        share = float(np.exp(generator.uniform(*np.log(AIM))))
        case = as_strong(effect, case_seed, (share, share))
    else:
        kinds, chances = ('nulls', 'mixed_forms', 'catalogue'), [NOTHING, UNKNOWN]
        chosen = generator.choice(kinds, p=[*chances, 1.0 - sum(chances)])
        case = drawn_case(str(chosen), case_seed)
    return case, {'concealed': [law.name for law in case.laws]} | plant_to_mapping(case.true)


def of_other_simulator(
    generator: Generator, effect: str | None, aims: tuple[float, float] = AIM
) -> tuple[Case, dict]:
    """A rig of sliding nodes; an effect that is given moves a share of the signal between two."""
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
    """A law that moves a drawn share of the signal, drawn again where it cannot."""
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
