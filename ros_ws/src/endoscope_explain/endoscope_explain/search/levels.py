"""The search: what one term more explains, as often as that is more than another form could.

At each level all terms are screened by linear algebra, the most promising are fitted in the
simulator, and the evidence ranks them, functions and formulas alike. Rigs in which nothing is
missing, run through the same screen, say how much evidence there is then.

Several recordings of a rig whose tube is bent differently in each keep its physics, and only its
parameters change. Explained one by one, two of them may well be given different names for the same
misfit: they are searched as one, by the sum of the evidence, and fitted together.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from endoscope_core.physics.effects import lacking
from endoscope_core.workers import parallel_map
from endoscope_explain.fit.model import Fit
from endoscope_explain.fit.nominal import is_at_tolerance, with_any_numbers
from endoscope_explain.search.expansion import (
    Parent,
    Screened,
    expanded,
    first_of_each,
    screen_terms,
)
from endoscope_explain.search.left_out import LEAST_RECORDINGS, chance
from endoscope_explain.search.null_rigs import (
    NO_DETECTABLE_GAIN,
    Null,
    null_of_several,
    null_rigs,
)
from endoscope_explain.search.refit import (
    Candidate,
    by_fine_derivatives,
    candidate,
    converged,
)

MOST_EFFECTS = 2
FALSE_ALARMS = 0.025
"""Chance that rigs in which nothing is missing show as much, above which no term is added: 2 % are
wanted, and 39 rigs tell no less."""
MOST_FITS, WORTH_A_FIT = 6, 1.0
"""Fits of what every rig has, without which all other numbers were bent, and the gain of evidence
in nats that is worth another one."""
PARENTS = 2
"""Candidates that are added to."""


@dataclass(frozen=True)
class Level:
    """Candidates with one term more."""

    parent: Candidate  # the best of those that were added to
    found: tuple[Candidate, ...]  # best first
    null: Null  # what is shown where nothing is missing
    # Whether the best one predicts blocks that it has not seen better than its parent.
    predicts: bool = True
    # Whether candidates are judged by leaving each recording out: the best first by that.
    by_left_out: bool = False

    def gain(self, one: Candidate) -> float:
        """Logarithm of the evidence of a candidate over its parent's."""
        return one.evidence - self.parent.evidence

    @property
    def best(self) -> Candidate:
        """The candidate to go on with."""
        # Other numbers, then what every rig has, and then a formula stand where they lose no more
        # than form is worth.
        top, worth = self.found[0], self.form_is_worth()
        if self.by_left_out:
            return top

        def first(candidates: Iterable[Candidate]) -> Candidate | None:
            return next((c for c in candidates if top.evidence - c.evidence <= worth), None)

        stands = first(c for c in self.found if self.adds_nothing(c))
        stands = stands or first(c for c in self.found if c.adds_nominal)
        if stands is None and not self.adds_nothing(top) and top.terms[-1].is_function:
            stands = first(c for c in self.at_the_place_of(top) if not c.terms[-1].is_function)
        return stands or top

    def adds_nothing(self, one: Candidate) -> bool:
        """Whether a candidate has other numbers than its parent, and no term more."""
        return len(one.terms) == len(self.parent.terms)

    def form_is_worth(self) -> float:
        """Evidence by which an error of form as large as what is left may mislead."""
        return max(float(np.quantile(self.null.doubt, 1.0 - FALSE_ALARMS)), 0.0)

    def at_the_place_of(self, one: Candidate) -> tuple[Candidate, ...]:
        """Candidates whose last term is at the same place, beside the same other terms."""
        rest = {term.id for term in one.terms[:-1]}
        return tuple(
            each
            for each in self.found
            if each.terms
            and {term.id for term in each.terms[:-1]} == rest
            and each.terms[-1].shares_place(one.terms[-1])
        )

    @property
    def p_value(self) -> float:
        """Chance that a rig in which nothing is missing shows as much as the best candidate."""
        if self.by_left_out:
            return chance(self.best.foretold - self.parent.foretold)
        return self.null.p_value(self.gain(self.best)) if self.found else 1.0

    @property
    def is_found(self) -> bool:
        """Whether something is missing, and found."""
        if self.by_left_out:
            return self.p_value <= FALSE_ALARMS
        # Nominal physics needs no more than to be worth its numbers: that a rig has none is no
        # hypothesis.
        if self.found and self.best.adds_nominal:
            return self.gain(self.best) > 0.0 and self.predicts
        return self.p_value <= FALSE_ALARMS and self.predicts

    def variants(self) -> tuple[Candidate, ...]:
        """The best candidate's effects acting on something else: beside another they may win."""
        ids = [term.id for term in self.best.terms]
        return tuple(
            c for c in self.found if c is not self.best and [term.id for term in c.terms] == ids
        )

    def rivals(self) -> tuple[Candidate, ...]:
        """Candidates behind the best one by no more than form is worth."""
        if self.by_left_out:
            best, *behind = self.found
            return tuple(c for c in behind if chance(best.foretold - c.foretold) > FALSE_ALARMS)
        least = self.found[0].evidence - self.form_is_worth()
        return tuple(c for c in self.found if c is not self.best and c.evidence >= least)


@dataclass(frozen=True)
class JointSearch:
    """What was tried on one joint, in one recording or in several of the same rig."""

    nominal: Candidate  # no term added
    # With one, two, ... terms; the last one may have found nothing.
    levels: tuple[Level, ...]

    @property
    def found(self) -> Candidate:
        """The last candidate that was found, the nominal plant where none was."""
        found = [level.best for level in self.levels if level.is_found]
        return found[-1] if found else self.nominal

    def tried(self) -> list[Candidate]:
        """All candidates, the one without any term first."""
        return [self.nominal, *(c for level in self.levels for c in level.found)]


def search(
    recordings: Sequence[tuple[Fit, ...]],
    jobs: int,
    depth: int = MOST_EFFECTS,
    left_out: tuple[str, ...] = (),
    tell: Callable[[str], None] = lambda _: None,
) -> JointSearch:
    """Search what is missing from a joint: `depth` terms at most beside nominal physics.

    Of each recording there is the nominal plant refitted, and as described if given. In several of
    a rig only effects are searched: a function has the range of one motion.
    """
    nominal = candidate((), *(references[0] for references in recordings))
    joint = nominal.fits[0].model.observation.joint
    depth += sum(each.in_every_rig for each in lacking(nominal.fits[0].model.base))
    if not nominal.is_noise:
        # What only the numbers are still worth is no gain of a term.
        nominal = converged(converged(nominal))
    beside = zip(nominal.fits, recordings, strict=True)
    parents = [Parent(nominal, tuple((found, *described) for found, (_, *described) in beside))]
    levels: list[Level] = []
    while len(parents[0].candidate.terms) < depth and not parents[0].candidate.is_noise:
        changed = any(each.adds_nothing(each.best) for each in levels)
        level = _level(parents, jobs, left_out, other_numbers=not changed)
        levels.append(level)
        tell(f'{joint}: {_told(level)}')
        if not level.is_found:
            break
        best = level.best
        if best.adds_nominal:
            best = _from_afar(best)
            found = tuple(best if c is level.best else c for c in level.found)
            levels[-1] = level = replace(level, found=found)
        others = [] if level.adds_nothing(best) else [*level.variants(), *level.rivals()]
        others = [c for c in others if not level.adds_nothing(c)][: PARENTS - 1]
        parents = [
            Parent(each, tuple((own,) for own in each.fits))
            for each in (best, *map(converged, others))
        ]
    if parents[0].candidate.is_noise:
        tell(f'{joint}: only noise is left beside {_names(parents[0].candidate) or "nothing"}')
    return JointSearch(nominal, tuple(levels))


def _names(one: Candidate) -> str:
    return ', '.join(term.id for term in one.terms)


def _told(level: Level) -> str:
    """What came of a level, in words."""
    if not level.found:
        return 'no term moves anything'
    names = _names(level.best) or 'other numbers'
    gain = level.gain(level.best)
    if level.is_found:
        return f'{names}, better by {gain:.0f} nats'
    if not level.predicts:
        return f'not {names}: better by {gain:.0f} nats, but not on what it was not fitted to'
    if level.by_left_out:
        return f'not {names}: better by {gain:.0f} nats, but not in recordings that are left out'
    share = f'{level.p_value:.1%} of rigs without it show as much'
    return f'not {names}: better by {gain:.0f} nats, but {share}'


def _from_afar(one: Candidate) -> Candidate:
    """A candidate whose numbers have far to go, fitted again by what each fit leaves."""
    for _ in range(MOST_FITS):
        again = converged(one)
        if again.evidence - one.evidence < WORTH_A_FIT:
            break
        one = again
    return one


def _level(
    parents: Sequence[Parent], jobs: int, left_out: tuple[str, ...], *, other_numbers: bool
) -> Level:
    first = parents[0].candidate
    screens = [screen_terms(parent, jobs, left_out) for parent in parents]
    found = [each for screen in screens for each in expanded(screen, jobs)]
    found += [
        converged(candidate(parent.candidate.terms, *map(with_any_numbers, parent.candidate.fits)))
        for parent in parents
        if other_numbers and any(map(is_at_tolerance, parent.candidate.fits))
    ]
    found.sort(key=lambda c: -c.evidence)
    ranked = tuple(first_of_each(found, lambda c: frozenset(term.variant for term in c.terms)))
    if not ranked:
        return Level(first, (), NO_DETECTABLE_GAIN)
    if len(first.fits) >= LEAST_RECORDINGS:
        return _by_left_out(first, ranked, jobs)
    if not ranked[0].is_noise:
        ranked = (by_fine_derivatives(ranked[0]), *ranked[1:])
    level = _beside_nothing_missing(Level(first, ranked, NO_DETECTABLE_GAIN), screens[0], jobs)
    return replace(level, predicts=level.best.unseen_misfit < first.unseen_misfit)


def _by_left_out(first: Candidate, ranked: Sequence[Candidate], jobs: int) -> Level:
    """A level whose candidates are judged in recordings that were left out."""
    settled = parallel_map(converged, ranked, jobs)
    gains = [each.foretold - first.foretold for each in settled]
    # What all recordings confirm is first, then what is worth more to all of them.
    order = sorted(
        range(len(settled)),
        key=lambda k: (chance(gains[k]) > FALSE_ALARMS, -float(np.sum(gains[k]))),
    )
    found = tuple(settled[k] for k in order)
    return Level(first, found, NO_DETECTABLE_GAIN, by_left_out=True)


def _beside_nothing_missing(level: Level, screen: Screened, jobs: int) -> Level:
    """A level with what rigs show in which nothing is missing."""
    if len(screen.behind) > 1:
        top = level.found[0]
        null = null_of_several(screen.behind, screen.ways, top.fits, level.gain(top), jobs)
        return replace(level, null=null)
    rigs = null_rigs(screen.behind[0], screen.ways[0], level.found[0].fit, jobs)
    if rigs is None:
        return level
    level = replace(level, null=rigs.as_screened())
    if level.best.adds_nominal:
        return level
    return replace(level, null=rigs.beside(level.gain(level.best), FALSE_ALARMS, jobs))
