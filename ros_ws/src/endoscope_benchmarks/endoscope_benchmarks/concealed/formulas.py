"""Effects of the catalogue, each in its own formula with numbers drawn for it."""

import math
from collections.abc import Callable

import numpy as np

from endoscope_core.physics import EffectSpec
from endoscope_core.physics.effect import Effect, Parameter
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.effects.laws import ONSETS
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.places import OTHER_ANGLE

Formula = Callable[[float], EffectSpec]
"""From the strength to the effect; at zero it vanishes."""

DRAWN = tuple(each.id for each in CATALOGUE.values() if not each.traits.audited)
"""Effects that are drawn: all but those that only an audit of a bag can see."""
OF_THE_OTHER = frozenset(
    each.id
    for each in CATALOGUE.values()
    if any(FUNCTIONS[place].argument is OTHER_ANGLE for place in each.traits.families)
)
"""Effects that the other joint causes."""
_WIDEST = 1e3
"""Ratio of a parameter's starts above which there is nothing between them."""
WIDER = 1.5
"""Factor by which what is drawn reaches beyond where a search begins, on either side."""
_WITHIN = (0.25, 0.7)
"""Share of the recording in which something happens."""


def drawn_formula(
    generator: np.random.Generator, effect_id: str, joint: str, duration: float
) -> Formula:
    """Draw everything about an effect but its strength, for a recording of a duration in s."""
    effect = CATALOGUE[effect_id]
    # What makes the effect vanish is its strength: some of the parameters that do so are drawn, and
    # grow together. An effect that is a limit comes the nearer the stronger it is.
    sizes = [p for p in effect.parameters if math.isfinite(p.off) and p.off < p.high]
    limits = [] if sizes else [p for p in effect.parameters if p.off == p.high]
    chosen = [p for p in sizes if generator.random() < 0.5] or sizes[:1]
    growth = {p.name: _growth(generator, p) for p in chosen}
    fixed = _settings(generator, effect, {p.name for p in (*sizes, *limits)}, duration)

    def formula(strength: float) -> EffectSpec:
        grown = {p.name: p.off + strength * growth.get(p.name, 0.0) for p in sizes}
        nearer = {p.name: p.off / (1.0 + strength) for p in limits}
        return EffectSpec(effect_id, joint, {**fixed, **grown, **nearer})

    return formula


def _growth(generator: np.random.Generator, parameter: Parameter) -> float:
    values = [abs(v - parameter.off) for v in (*parameter.starts, parameter.typical)]
    size = next((v for v in values if v > 0.0), 0.1 * (parameter.high - parameter.low))
    sign = generator.choice([-1.0, 1.0]) if parameter.low < parameter.off else 1.0
    return float(sign * size * generator.uniform(0.3, 1.0))


def _settings(
    generator: np.random.Generator, effect: Effect, but: set[str], duration: float
) -> dict[str, float]:
    return {
        p.name: duration if p.is_duration else _setting(generator, p, duration)
        for p in effect.parameters
        if p.name not in but
    }


def _setting(generator: np.random.Generator, parameter: Parameter, duration: float) -> float:
    if parameter.choices:
        return float(generator.choice(parameter.choices))
    if parameter.counted:
        return float(generator.integers(int(parameter.low), int(parameter.high) + 1))
    if parameter.phase:
        return float(generator.uniform(-math.pi, math.pi))
    if parameter.starts == ONSETS:
        return float(generator.uniform(*_WITHIN) * duration)
    values = np.array([*parameter.starts, parameter.typical])
    sizes = np.abs(values)
    if sizes.min() == 0.0:
        drawn = generator.uniform(min(values.min(), 0.0), WIDER * values.max())
    elif sizes.max() / sizes.min() > _WIDEST:
        drawn = generator.choice(values) * WIDER ** generator.uniform(-1.0, 1.0)
    else:
        ends = np.log([sizes.min() / WIDER, sizes.max() * WIDER])
        drawn = generator.choice(np.sign(values)) * np.exp(generator.uniform(*ends))
    return float(np.clip(drawn, parameter.low, parameter.high))
