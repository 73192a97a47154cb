"""Which effects a joint's recording shows: nominal refit, singles, and a beam of more."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.beyond_band import beyond_band, leans
from endoscope_explain.compose import (
    Composition,
    Parent,
    grow,
    searchable_effects,
)
from endoscope_explain.fit.model import Fit
from endoscope_explain.fit.score import NEARLY_NOISE, score
from endoscope_explain.fit.whiteness import is_noise, slips
from endoscope_explain.many_starts import from_many_starts
from endoscope_explain.parallel import parallel_map
from endoscope_explain.reconsider import reconsidered
from endoscope_explain.refit_from_description import from_description, promised_by_description
from endoscope_explain.repeated_motion import DEPENDS_ON_TIME, motion_repeats
from endoscope_explain.robust_refit import robustly_refitted
from endoscope_explain.whole_numbers import with_counted_numbers

SINGLES_POLISHED = 6
PAIRS_POLISHED = 3
BEAM = 3
MOST_EFFECTS = 2
RIVALS = 0.5
"""Share of the best composition's gain from which on a lesser one is worth adding to as well."""
HOPELESS = 0.03
"""Where no single effect removes this share of the excess misfit, no second one is tried."""


@dataclass(frozen=True)
class JointSearch:
    """What was tried on one joint.

    Attributes
    ----------
    nominal : Composition
        No effect added.
    levels : tuple of tuple of Composition
        Compositions of one, two, ... effects, each best first.
    beyond : Composition, optional
        No effect added, with nominal numbers that may leave their band, where the best composition
        leans on its end.
    """

    nominal: Composition
    levels: tuple[tuple[Composition, ...], ...]
    beyond: Composition | None = None

    def tried(self) -> list[Composition]:
        """Return all compositions, those without effects first."""
        alone = [self.nominal] if self.beyond is None else [self.nominal, self.beyond]
        return [*alone, *(c for level in self.levels for c in level)]


def search(
    anchors: tuple[Fit, Fit],
    jobs: int,
    depth: int = MOST_EFFECTS,
    known: tuple[str, ...] = (),
) -> JointSearch:
    """Search the compositions of effects on one joint.

    Parameters
    ----------
    anchors : (Fit, Fit)
        Nominal plant refitted, and as described.
    jobs : int
        Tasks side by side.
    depth : int
        Largest number of effects.
    known : tuple of str
        Effects that the plant has already and that are not looked for again.

    Returns
    -------
    JointSearch
        Without effects that depend on time where the joint makes no motion twice.
    """
    nominal = Composition((), anchors[0], score(anchors[0]))
    levels: list[tuple[Composition, ...]] = []
    if is_noise(nominal.fit):
        return JointSearch(nominal, ())
    effects = tuple(e for e in searchable_effects() if e not in known)
    if not motion_repeats(anchors[0].model.observation):
        effects = tuple(e for e in effects if e not in DEPENDS_ON_TIME)
    beyond = None
    parents: list[Parent] = [(nominal, anchors)]
    for level in range(depth):
        most = SINGLES_POLISHED if level == 0 else PAIRS_POLISHED
        grown = grow(parents, effects, jobs, most)
        if level == 0 and _may_be_led_astray(grown):
            promised = promised_by_description(anchors[1], effects, jobs)
            grown = list(_sorted(grown, promised))
        if level > 0 and _may_be_led_astray(grown):
            grown = list(_sorted(grown, from_description(grown, anchors[1], jobs)))
        if level > 0 and _may_be_led_astray(grown):
            grown = list(_sorted(grown, _grown_robustly(parents, effects, jobs)))
        if grown and _is_rugged(grown[0]) and not is_noise(grown[0].fit):
            grown[0] = from_many_starts(grown[0], anchors[1], jobs)
        if grown:
            grown[0] = with_counted_numbers(grown[0], jobs)
        levels.append(tuple(grown))
        if beyond is None and leans(min((nominal, *grown), key=lambda c: c.score).fit):
            beyond = beyond_band(nominal)
        if (
            not grown
            or is_noise(grown[0].fit)
            or (beyond is not None and is_noise(beyond.fit))
            or (grown[0].score > nominal.score - HOPELESS * (nominal.score - grown[0].floor()))
        ):
            break
        needed = RIVALS * (nominal.score - grown[0].score)
        parents = [(c, (c.fit,)) for c in grown[:BEAM] if nominal.score - c.score >= needed]
    if len(levels) == 2 and levels[1]:
        singles, pairs = reconsidered(nominal, levels[1][0], effects, jobs)
        levels = [_sorted(levels[0], singles), _sorted(levels[1], pairs)]
    if beyond is not None and not any(is_noise(c.fit) for c in levels[-1][:1]):
        levels[0] = _sorted(levels[0], _grown_beyond(beyond, anchors[1], effects, jobs))
    return JointSearch(nominal, tuple(levels), beyond)


def _is_rugged(composition: Composition) -> bool:
    alone = len(composition.effects) == 1
    return alone and CATALOGUE[composition.effects[0]].traits.rugged


def _grown_beyond(
    beyond: Composition, described: Fit, effects: Sequence[str], jobs: int
) -> list[Composition]:
    """Single effects beside nominal numbers that may leave their band.

    They are believed only where nothing but noise is left.
    """
    anchors = (beyond.fit, replace(described, model=beyond.fit.model))
    grown = grow([(beyond, anchors)], effects, jobs, SINGLES_POLISHED)
    return [c for c in grown if is_noise(c.fit)]


def _may_be_led_astray(grown: Sequence[Composition]) -> bool:
    """Return whether much is left, and not by slips, whose instants are nobody's to explain."""
    return (
        bool(grown)
        and grown[0].above_noise() > NEARLY_NOISE
        and not slips(grown[0].fit.model.observation)
    )


def _grown_robustly(
    parents: Sequence[Parent], effects: Sequence[str], jobs: int
) -> list[Composition]:
    """Add to what the parents say of the larger part of the motion."""
    fits = parallel_map(lambda parent: robustly_refitted(parent[0].fit), parents, jobs)
    robust = [(c, (found,)) for (c, _), found in zip(parents, fits, strict=True)]
    return grow(robust, effects, jobs, PAIRS_POLISHED)


def _sorted(found: Sequence[Composition], more: Sequence[Composition]) -> tuple[Composition, ...]:
    """Compositions best first, each set of effects once."""
    unique: dict[frozenset[str], Composition] = {}
    for composition in sorted((*found, *more), key=lambda c: c.score):
        unique.setdefault(frozenset(composition.effects), composition)
    return tuple(unique.values())
