"""Rigs for the proof, each with an injected effect, or without one."""

from dataclasses import replace

import numpy as np

from endoscope_core.errors import EndoscopeError, nearest
from endoscope_core.physics import PlantDescription
from endoscope_core.physics.effect import Stage
from endoscope_core.physics.effects import describe
from endoscope_core.physics.plant_file import plant_to_mapping
from endoscope_lab.concealed.another_rig import FORMS
from endoscope_lab.concealed.forms import DRAWN
from endoscope_lab.concealed.judge import Case
from endoscope_lab.concealed.other_simulator import NOTHING, of_other_simulator
from endoscope_lab.concealed.strata import as_strong, drawn_case
from endoscope_lab.concealed.strength import AIM
from endoscope_lab.proof import OTHER, SLAVE
from endoscope_nodes.names import JOINTS

Generator = np.random.Generator

UNKNOWN = 1.0 / 6.0
"""Share of the rigs with an injected law that is not in the catalogue."""


class NoSuchEffectError(EndoscopeError, ValueError):
    """An effect that cannot be injected."""


def require_drawn(effect: str, form: str) -> None:
    """Raise NoSuchEffectError for an effect that cannot be injected into rigs of a form."""
    known = list(FORMS if form == OTHER else DRAWN)
    if form == SLAVE:
        known = [each for each in known if describe(each).stage is not Stage.RECORDING]
    if effect not in known:
        raise NoSuchEffectError(
            f'--effect {effect}: with --form {form} {nearest(effect, sorted(known))}'
        )


def drawn(form: str, seed: int, number: int, effect: str | None = None) -> tuple[Case, dict]:
    """Draw a rig of `SIMULATORS` or `SLAVE` and, unless given, its effect; with truth as data."""
    generator = np.random.default_rng([seed, number])
    if form == OTHER:
        return of_other_simulator(generator, effect)
    return _of_slave(generator, effect) if form == SLAVE else _own(generator, effect)


def _of_slave(generator: Generator, effect: str | None) -> tuple[Case, dict]:
    """A rig of both joints, with an effect that a running slave can have."""
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
