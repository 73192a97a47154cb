"""Which cases a bench draws: strata in fixed shares, every effect as often as every other."""

from dataclasses import dataclass

import numpy as np

from endoscope_explain.generator.effect_choice import EFFECTS, NOT_IN_A_CHAIN, OUTSIDE

# Stratum, motion, share of the cases.
SHARES = (
    ('single', 'commissioning', 0.32),
    ('pair', 'commissioning', 0.12),
    ('weak', 'commissioning', 0.14),
    ('single', 'calibration', 0.16),
    ('null', 'commissioning', 0.10),
    ('outside', 'commissioning', 0.10),
    ('foreign', 'commissioning', 0.06),
)


@dataclass(frozen=True)
class CaseRequest:
    """Arguments of one `draw_case`.

    Attributes
    ----------
    seed, stratum, motion
        As `draw_case` takes them.
    effects
        Ids to conceal; None leaves the choice to the draw.
    """

    seed: int
    stratum: str
    motion: str
    effects: tuple[str, ...] | None


def plan_cases(count: int, seed: int) -> list[CaseRequest]:
    """Plan `count` cases; all seeds differ, and another `seed` gives other cases.

    Within a stratum the effects come in a random order, each once before any comes again.

    Raises
    ------
    ValueError
        `count` is less than one.
    """
    if count < 1:
        raise ValueError(f'{count} cases asked for: at least one is needed')
    rng = np.random.default_rng([seed, count])
    requests: list[CaseRequest] = []
    for stratum, motion, number in _numbers(count):
        names = _effects_of(stratum)
        order: list[str] = []
        while names and len(order) < number:
            order.extend(str(name) for name in rng.permutation(names))
        for k in range(number):
            effects = (order[k],) if order else None
            requests.append(CaseRequest(seed * 1_000_000 + len(requests), stratum, motion, effects))
    return requests


def _numbers(count: int) -> list[tuple[str, str, int]]:
    """Cases of each stratum, rounded so that they add up to `count`."""
    ends = np.round(np.cumsum([share for *_, share in SHARES]) * count).astype(int)
    numbers = np.diff(ends, prepend=0)
    return [(s, m, int(n)) for (s, m, _), n in zip(SHARES, numbers, strict=True)]


def _effects_of(stratum: str) -> list[str]:
    if stratum in ('single', 'weak'):
        return list(EFFECTS)
    if stratum == 'outside':
        return list(OUTSIDE)
    if stratum == 'foreign':
        return [name for name in EFFECTS if name not in NOT_IN_A_CHAIN]
    return []
