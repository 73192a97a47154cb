"""The strata of the benchmark: how each draws its cases."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics import PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.places import BOTH_TENSIONS, DISTANCE, OTHER_ANGLE, TIME
from endoscope_lab.concealed import motions
from endoscope_lab.concealed.forms import (
    DRAWN,
    OF_THE_OTHER,
    drawn_form,
    drawn_formula,
    visited,
)
from endoscope_lab.concealed.judge import Case, Law, effects_at, law_at_place, law_of_effect
from endoscope_lab.concealed.other_simulator import of_other_simulator
from endoscope_lab.concealed.readings import Noise, Readings, read, record
from endoscope_lab.concealed.rigs import (
    coarse_sensors,
    described_rig,
    other_sheath,
    true_rig,
)
from endoscope_lab.concealed.strength import AIM, drawn_as_strong

Array = NDArray[np.float64]
Generator = np.random.Generator
Added = Callable[[PlantDescription, float], PlantDescription]
"""Adds a law of some strength to a rig."""
Motion = Callable[[Generator, int], Array]

WEAKER = 0.1
FORM_AIM = (0.02, 0.05)
"""Share of the signal moved by a form of the sheath that is not an injected law."""
FACTOR = (0.3, 1.0)
"""Range of the rms variation of a form that multiplies another one."""
_BEGIN = 0.02
"""Share of the largest value at a place at which the search for a law's strength starts."""

# The mean tension of both wires does not change while neither is slack.
PLACES = tuple(p for p in FUNCTIONS if FUNCTIONS[p].argument is not BOTH_TENSIONS)
"""Places at which a law is observable."""
_FAMILIES = [p for p in PLACES if effects_at(p)]
_OUTSIDE = [p for p in PLACES if not effects_at(p)]
_PAIRS = [
    (p, other)
    for p in PLACES
    for other in PLACES
    if FUNCTIONS[p].point == FUNCTIONS[other].point
    and FUNCTIONS[p].argument.symbol != FUNCTIONS[other].argument.symbol
    and {FUNCTIONS[p].argument, FUNCTIONS[other].argument} != {TIME, DISTANCE}
]
"""Places of two states with the same point of action, except time with distance: both only grow."""
_WITH_FAMILIES = [e for e in DRAWN if set(CATALOGUE[e].traits.families) & set(PLACES)]


@dataclass(frozen=True)
class _Rig:
    """A rig under construction: described, true, and the motion of its recording."""

    described: PlantDescription
    true: PlantDescription
    command: Array


def catalogue(
    generator: Generator, seed: int, motion: Motion = motions.commissioning, weaker: float = 1.0
) -> Case:
    """One effect in its own formula."""
    effect = _turn(DRAWN, seed)
    rig = _rig(generator, _joints_of(effect), motion)
    aims = (weaker * AIM[0], weaker * AIM[1])
    return _finished(generator, seed, rig, *_with_effect(generator, rig, effect, aims))


def leave_a_form_out(generator: Generator, seed: int) -> Case:
    """One effect in its own formula, which is withheld from explain."""
    effect = _turn(_WITH_FAMILIES, seed)
    rig = _rig(generator, _joints_of(effect))
    case = _finished(generator, seed, rig, *_with_effect(generator, rig, effect))
    return replace(case, left_out=(effect,))


def mixed_forms(generator: Generator, seed: int) -> Case:
    """A drawn form at a place of an effect's family."""
    place = _turn(_FAMILIES, seed)
    rig = _rig(generator, _joints_of(place))
    return _finished(generator, seed, rig, *_with_form(generator, rig, place))


def outside(generator: Generator, seed: int) -> Case:
    """A drawn form at a place outside all effects' families; two forms in every fourth case."""
    place = _turn(_OUTSIDE, seed)
    rig = _rig(generator, _joints_of(place))
    true, law, share = _with_form(generator, rig, place)
    if seed % 4:
        return _finished(generator, seed, rig, true, law, share)
    rest = [p for p in _OUTSIDE if _joints_of(p) <= len(rig.true.joints) and p != place]
    second = str(generator.choice(rest))
    true, other, least = _with_form(generator, replace(rig, true=true), second)
    case = _finished(generator, seed, rig, true, law, min(share, least))
    return replace(case, laws=(law, other))


def two_states(generator: Generator, seed: int) -> Case:
    """A drawn form of one state, multiplied by a drawn form of another state."""
    place, other = _turn(_PAIRS, seed)
    rig = _rig(generator, max(_joints_of(place), _joints_of(other)))
    case = _finished(generator, seed, rig, *_with_form(generator, rig, place, times=other))
    return replace(case, also=frozenset({other}) | effects_at(other), note=f'times {other}')


def another_sheath(generator: Generator, seed: int) -> Case:
    """Sheath and joint of another form; every second case has an effect, two of four a baseline."""
    effect = _turn(DRAWN, seed // 2)
    rig = _rig(generator, _joints_of(effect))
    rig = replace(rig, true=other_sheath(generator, rig.true))
    place = str(generator.choice(['exponent_of_angle', 'stiffness_of_tension']))
    for joint in rig.true.joints:
        true, _, _ = _with_form(generator, rig, place, joint, FORM_AIM)
        rig = replace(rig, true=true)
    if seed % 2:
        case = _finished(generator, seed, rig, *_with_effect(generator, rig, effect))
    else:
        case = _finished(generator, seed, rig, rig.true, None, 0.0)
    baseline = None
    if seed // 2 % 2:
        command = motions.commissioning(generator, len(rig.true.joints))
        baseline = record(rig.true, command, _noise_seed(generator))
    also = frozenset({place}) | effects_at(place)
    note = f'{place}, {"with" if baseline else "no"} baseline'
    return replace(case, baseline=baseline, also=also, note=note)


def nulls(generator: Generator, seed: int) -> Case:
    """Null cases: other parameters, slow noise, coarse sensors, heavy tails, in turn."""
    kind = ('numbers', 'slow noise', 'coarse sensors', 'heavy tails')[seed % 4]
    rig = _rig(generator, 1, drilled=kind == 'numbers')
    noise = {
        'slow noise': Noise(generator.uniform(0.3, 1.0), generator.uniform(0.5, 4.0)),
        'heavy tails': Noise(freedom=generator.uniform(3.0, 5.0)),
    }.get(kind)
    if kind == 'coarse sensors':
        rig = replace(rig, true=replace(rig.true, sensors=coarse_sensors(generator)))
    return replace(_finished(generator, seed, rig, rig.true, None, 0.0, noise), note=kind)


def pairs(generator: Generator, seed: int) -> Case:
    """Two effects of different stages on a rig of two joints."""
    rig = _rig(generator, 2)
    first = _turn(DRAWN, seed)
    others = [e for e in DRAWN if CATALOGUE[e].stage != CATALOGUE[first].stage]
    true, law, share = _with_effect(generator, rig, first)
    second = str(generator.choice(others))
    both, other, least = _with_effect(generator, replace(rig, true=true), second)
    case = _finished(generator, seed, rig, both, law, min(share, least))
    return replace(case, laws=(law, other))


def other_simulator(_: Generator, seed: int) -> Case:
    """A rig of `endoscope prove --form other`: sliding nodes, and laws of other forms."""
    generator = np.random.default_rng([seed, 0])
    return replace(of_other_simulator(generator, None)[0], seed=seed)


def as_strong(effect: str, seed: int, aims: tuple[float, float]) -> Case:
    """One effect that moves a share of the signal in a range; RuntimeError if it cannot."""
    # The rig is the same for the same seed.
    generator = np.random.default_rng([_BY_STRENGTH, DRAWN.index(effect), seed])
    rig = _rig(generator, _joints_of(effect))
    return _finished(generator, seed, rig, *_with_effect(generator, rig, effect, aims))


STRATA: dict[str, Callable[[Generator, int], Case]] = {
    'catalogue': catalogue,
    'leave_a_form_out': leave_a_form_out,
    'mixed_forms': mixed_forms,
    'outside': outside,
    'other_sheath': another_sheath,
    'nulls': nulls,
    'pairs': pairs,
    'tenth': partial(catalogue, weaker=WEAKER),
    'sinusoid': partial(catalogue, motion=motions.sinusoid),
    'teleoperation': partial(catalogue, motion=motions.teleoperation),
    'two_states': two_states,
    'other_simulator': other_simulator,
}
_BY_STRENGTH = 11
"""Replaces a stratum's number in the seed, and must not change."""


def drawn_case(stratum: str, seed: int) -> Case:
    """Draw a case, the same one for the same seed; KeyError for an unknown stratum."""
    generator = np.random.default_rng([list(STRATA).index(stratum), seed])
    return replace(STRATA[stratum](generator, seed), stratum=stratum)


def _rig(
    generator: Generator, joints: int, motion: Motion = motions.commissioning, drilled: bool = False
) -> _Rig:
    described = described_rig(generator, joints)
    return _Rig(described, true_rig(generator, described, drilled), motion(generator, joints))


def _with_effect(
    generator: Generator, rig: _Rig, effect_id: str, aims: tuple[float, float] = AIM
) -> tuple[PlantDescription, Law, float]:
    joint = str(generator.choice(list(rig.true.joints)))
    law = law_of_effect(effect_id, joint)
    joints = [joint] if law.joint else list(rig.true.joints)

    def drawn() -> tuple[Added, float]:
        formula = drawn_formula(generator, effect_id, joint, 1e-3 * len(rig.command))

        def added(plant: PlantDescription, strength: float) -> PlantDescription:
            specs = [replace(formula(strength), joint=name) for name in joints]
            return replace(plant, effects=(*plant.effects, *specs))

        return added, 1.0

    true, share = _injected(generator, rig, drawn, aims)
    return true, law, share


def _with_form(
    generator: Generator,
    rig: _Rig,
    place: str,
    joint: str | None = None,
    aim: tuple[float, float] = AIM,
    times: str = '',
) -> tuple[PlantDescription, Law, float]:
    joint = joint or str(generator.choice(list(rig.true.joints)))
    seen = visited(rig.true, rig.command, joint)

    def drawn() -> tuple[Added, float]:
        form, largest = drawn_form(generator, place, joint, seen[FUNCTIONS[place].argument])
        factors = []
        if times:
            factor, _ = drawn_form(generator, times, joint, seen[FUNCTIONS[times].argument])
            factors = [replace(factor(generator.uniform(*FACTOR)), multiplies=True)]

        def added(plant: PlantDescription, strength: float) -> PlantDescription:
            return replace(plant, terms=(*plant.terms, form(strength), *factors))

        return added, _BEGIN * largest

    true, share = _injected(generator, rig, drawn, aim)
    return true, law_at_place(place, joint), share


def _injected(
    generator: Generator,
    rig: _Rig,
    drawn: Callable[[], tuple[Added, float]],
    aims: tuple[float, float],
) -> tuple[PlantDescription, float]:
    """The rig with a law that moves a share of the signal, drawn again if it cannot."""

    def draw() -> tuple[Added, Callable[[float], Readings], float]:
        added, begin = drawn()
        return added, partial(_with_law, rig, added), begin

    added, strength, share = drawn_as_strong(generator, aims, draw)
    return added(rig.true, strength), share


def _with_law(rig: _Rig, added: Added, strength: float) -> Readings:
    return read(added(rig.true, strength), rig.command)


def _finished(
    generator: Generator,
    seed: int,
    rig: _Rig,
    true: PlantDescription,
    law: Law | None,
    share: float,
    noise: Noise | None = None,
) -> Case:
    command = motions.another(generator, len(true.joints))
    return Case(
        '',
        seed,
        rig.described,
        rig.true,
        true,
        () if law is None else (law,),
        record(true, rig.command, _noise_seed(generator), noise),
        record(true, command, _noise_seed(generator), noise),
        moved=share,
    )


def _turn[T](names: Sequence[T], seed: int) -> T:
    """Each name in turn, in an order unrelated to the chain."""
    order = np.random.default_rng(len(names)).permutation(len(names))
    return names[int(order[seed % len(names)])]


def _joints_of(name: str) -> int:
    """Number of joints on which an effect, or a law at a place, is observable."""
    if name in FUNCTIONS:
        return 2 if FUNCTIONS[name].argument is OTHER_ANGLE else 1
    return 2 if name in OF_THE_OTHER else 1


def _noise_seed(generator: Generator) -> int:
    return int(generator.integers(2**31))
