"""The search: what one term more explains, as often as that is more than another form could.

At each level all terms are screened by linear algebra, the most promising are fitted in the
simulator, and the evidence ranks them, functions and formulas alike. Rigs in which nothing is
missing, run through the same screen, say how much evidence there is then.

Several recordings of a rig whose tube is bent differently in each keep its physics, and only its
parameters change. Explained one by one, two of them may well be given different names for the same
misfit: they are searched as one, by the sum of the evidence, and fitted together.
"""

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from endoscope_core.physics.effects import lacking
from endoscope_explain.fit.model import Fit
from endoscope_explain.fit.nominal import is_at_tolerance, with_any_numbers
from endoscope_explain.parallel import parallel_map
from endoscope_explain.search.null_rigs import (
    NEAR,
    NO_DETECTABLE_GAIN,
    Null,
    null_of_several,
    null_rigs,
)
from endoscope_explain.search.refit import (
    Candidate,
    TrialFit,
    begun_beside,
    by_fine_derivatives,
    candidate,
    converged,
    cost_before,
    refined,
    refit,
    term_of,
    trial_fit,
)
from endoscope_explain.search.repetition import motion_repeats
from endoscope_explain.search.screen import (
    Background,
    Directions,
    background,
    by_variant,
    directions,
    screened,
)
from endoscope_explain.search.term import (
    Term,
    Variant,
    effects,
    functions,
)

MOST_EFFECTS = 2
FALSE_ALARMS = 0.025
"""Chance that rigs in which nothing is missing show as much, above which no term is added: 2 % are
wanted, and 39 rigs tell no less."""
TRIED, REFITTED = 10, 4
"""Terms that get a first fit and a full one: in the study the truth was among the first three of
the screen in 46 cases of 48, and among the first five in 47."""
STARTS = 2
"""Starting points of each: far from linear, that of the largest linearised gain may fit least."""
REFINED = 3
"""Functions of these, the best, that are let vary faster."""
SETTLED = 2
"""Of these the best ones and those at the place of the best are fitted until they stand."""
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

    def gain(self, one: Candidate) -> float:
        """Logarithm of the evidence of a candidate over its parent's."""
        return one.evidence - self.parent.evidence

    @property
    def best(self) -> Candidate:
        """The candidate to go on with."""
        # Other numbers, then what every rig has, and then a formula stand where they lose no more
        # than form is worth.
        top, worth = self.found[0], self.form_is_worth()

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
        return self.null.p_value(self.gain(self.best)) if self.found else 1.0

    @property
    def is_found(self) -> bool:
        """Whether something is missing, and found."""
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
    depth += len(lacking(nominal.fits[0].model.base))
    if not nominal.is_noise:
        # What only the numbers are still worth is no gain of a term.
        nominal = converged(converged(nominal))
    beside = zip(nominal.fits, recordings, strict=True)
    parents = [_Parent(nominal, tuple((found, *described) for found, (_, *described) in beside))]
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
            _Parent(each, tuple((own,) for own in each.fits))
            for each in (best, *map(converged, others))
        ]
    return JointSearch(nominal, tuple(levels))


@dataclass(frozen=True)
class _Parent:
    """A candidate that is added to."""

    candidate: Candidate
    # Of each recording, the candidate's fit, and others from which a trial fit may begin.
    references: tuple[tuple[Fit, ...], ...]


def _told(level: Level) -> str:
    """What came of a level, in words."""
    if not level.found:
        return 'no term moves anything'
    names = ', '.join(term.id for term in level.best.terms) or 'other numbers'
    gain = level.gain(level.best)
    if level.is_found:
        return f'{names}, better by {gain:.0f} nats'
    if not level.predicts:
        return f'not {names}: better by {gain:.0f} nats, but not on what it was not fitted to'
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
    parents: Sequence[_Parent], jobs: int, left_out: tuple[str, ...], *, other_numbers: bool
) -> Level:
    first = parents[0].candidate
    screens = [_screen(parent, jobs, left_out) for parent in parents]
    found = [each for screen in screens for each in _grown(screen, jobs)]
    found += [
        converged(candidate(parent.candidate.terms, *map(with_any_numbers, parent.candidate.fits)))
        for parent in parents
        if other_numbers and any(map(is_at_tolerance, parent.candidate.fits))
    ]
    found.sort(key=lambda c: -c.evidence)
    ranked = tuple(_first_of_each(found, lambda c: frozenset(term.variant for term in c.terms)))
    if not ranked:
        return Level(first, (), NO_DETECTABLE_GAIN)
    ranked = _that_predict(ranked, first)
    if not ranked[0].is_noise:
        ranked = (by_fine_derivatives(ranked[0]), *ranked[1:])
    level = _beside_nothing_missing(Level(first, ranked, NO_DETECTABLE_GAIN), screens[0], jobs)
    return replace(level, predicts=level.best.unseen_misfit < first.unseen_misfit)


def _beside_nothing_missing(level: Level, screen: '_Screen', jobs: int) -> Level:
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


def _that_predict(ranked: tuple[Candidate, ...], first: Candidate) -> tuple[Candidate, ...]:
    """Candidates, best first, from the first one on that predicts blocks better than its parent."""
    # A function of time can be anything: what it gains where it was fitted it loses where it was
    # not.
    for k, each in enumerate(ranked):
        if each.evidence > first.evidence and each.unseen_misfit < first.unseen_misfit:
            return ranked[k:]
    return ranked


@dataclass(frozen=True)
class _Screen:
    """Terms that may be added to a candidate, by recording."""

    parent: _Parent
    behind: tuple[Background, ...]
    ways: tuple[tuple[Directions, ...], ...]


def _screen(parent: _Parent, jobs: int, left_out: tuple[str, ...]) -> _Screen:
    behind = tuple(background(found) for found in parent.candidate.fits)
    terms = _terms(behind, left_out)
    ways = tuple(directions(b, own, jobs) for b, own in zip(behind, terms, strict=True))
    return _Screen(parent, behind, ways)


def _terms(behind: Sequence[Background], left_out: tuple[str, ...]) -> list[tuple[Term, ...]]:
    """What may be missing from the joint, of each recording."""
    if len(behind) == 1:
        (only,) = behind
        left = only.left(only.fit.residuals * only.weight)
        return [(*effects(only.fit, left_out), *functions(only.fit, left))]
    # What was fitted to one motion is not told from time by another.
    found = [
        [
            term
            for term in effects(each.fit, left_out)
            if not term.effect.traits.resembles_time or motion_repeats(each.fit.model.observation)
        ]
        for each in behind
    ]
    everywhere = set.intersection(*({term.id for term in terms} for terms in found))
    return [tuple(term for term in terms if term.id in everywhere) for terms in found]


def _grown(screen: _Screen, jobs: int) -> list[Candidate]:
    """The parent with one term more, the best first."""
    parent = screen.parent.candidate
    chosen = _worth_a_fit(_trials(screen, jobs))
    grown = parallel_map(lambda seen: refit(seen, parent), chosen, jobs)
    grown.sort(key=lambda c: -c.evidence)
    if grown and not grown[0].is_noise:
        grown = _with_finer_functions(grown, screen, jobs)
        grown = _with_their_formulas(grown, screen, jobs)
    return _settled(grown, jobs)


Trial = tuple[TrialFit | None, ...]
"""A term's first fit to each recording; None where that has no use for it."""


def _trials(screen: _Screen, jobs: int) -> list[tuple[float, Trial]]:
    """First fits of the likely terms, with the sum of the logarithms of their costs."""
    references = screen.parent.references
    likely = [
        _likely(*each, jobs) for each in zip(screen.behind, screen.ways, references, strict=True)
    ]
    tasks = [(n, term) for n, terms in enumerate(likely) for term in terms]

    def fitted(task: tuple[int, Term]) -> TrialFit:
        n, term = task
        return trial_fit(references[n], term, screen.behind[n].offset)

    best: dict[Variant, list[TrialFit | None]] = {}
    for (n, term), seen in zip(tasks, parallel_map(fitted, tasks, jobs), strict=True):
        own = best.setdefault(term.variant, [None] * len(references))
        before = own[n]
        if before is None or seen.cost < before.cost:
            own[n] = seen
    if len(references) == 1:
        return [(math.log(seen.cost), (seen,)) for (seen,) in best.values() if seen is not None]
    without = [cost_before(found) for found, *_ in references]
    trials = []
    for own in best.values():
        used = tuple(
            seen if seen is not None and seen.cost < cost else None
            for seen, cost in zip(own, without, strict=True)
        )
        costs = [c if seen is None else seen.cost for seen, c in zip(used, without, strict=True)]
        if any(seen is not None for seen in used):
            trials.append((sum(map(math.log, costs)), used))
    return trials


def _likely(
    behind: Background, ways: tuple[Directions, ...], references: tuple[Fit, ...], jobs: int
) -> list[Term]:
    """Terms of one recording that are worth a first fit."""
    likely = _best_screened(screened(behind, ways))
    for described in references[1:]:
        # What is missing has bent the fitted numbers, but not the described ones.
        unbent = background(described)
        terms = tuple(way.term for way in ways if not way.term.is_function)
        more = _best_screened(screened(unbent, directions(unbent, terms, jobs)))
        likely += [term for term in more if term.variant not in {t.variant for t in likely}]
    return likely


def _settled(grown: list[Candidate], jobs: int) -> list[Candidate]:
    """The best candidates, and those at the place of the best, fitted until they stand."""
    waiting, settled = list(grown), list[Candidate]()
    while waiting and waiting[0] is max([*settled, *waiting], key=lambda c: c.evidence):
        now = waiting[:SETTLED]
        now += [c for c in waiting[SETTLED:] if c.terms[-1].shares_place(now[0].terms[-1])]
        waiting = [c for c in waiting if all(c is not each for each in now)]
        settled += parallel_map(converged, now, jobs)
    return [*settled, *waiting]


def _with_finer_functions(grown: list[Candidate], screen: _Screen, jobs: int) -> list[Candidate]:
    """Candidates, best first, whose best functions are as fine as there is evidence for."""
    near = _near_the_best(grown, screen.parent.candidate)
    functions = [c for c in near if c.terms[-1].is_function][:REFINED]
    rest = [c for c in grown if all(c is not each for each in functions)]
    behind = screen.behind[0]
    finer = parallel_map(lambda c: refined(c, behind.fit, behind.offset), functions, jobs)
    return sorted([*finer, *rest], key=lambda c: -c.evidence)


def _near_the_best(grown: list[Candidate], parent: Candidate) -> list[Candidate]:
    """Candidates, best first, that may yet become the best one."""
    least = NEAR * (grown[0].evidence - parent.evidence)
    return [c for c in grown if c.evidence - parent.evidence >= least]


def _with_their_formulas(grown: list[Candidate], screen: _Screen, jobs: int) -> list[Candidate]:
    """Candidates, best first, with formulas fitted from the numbers that functions leave."""
    # What is missing bends the other numbers, and a formula far from linear, begun beside bent
    # ones, ends anywhere. The function at its place has set them straight.
    parent, behind = screen.parent.candidate, screen.behind[0]
    terms = [way.term for way in screen.ways[0]]
    tasks: list[tuple[Candidate, list[Term]]] = []
    for function in (c for c in _near_the_best(grown, parent) if c.terms[-1].is_function):
        starts: dict[str, list[Term]] = {}
        for term in terms:
            if not term.is_function and term.shares_place(function.terms[-1]):
                starts.setdefault(term.id, []).append(term)
        tasks += [(function, own) for own in starts.values()]

    def fitted(task: tuple[Candidate, list[Term]]) -> Candidate:
        function, own = task
        return refit((begun_beside(function.fit, parent.fit, own, behind.offset),), parent)

    more = parallel_map(fitted, tasks, jobs)
    every = sorted([*grown, *more], key=lambda c: -c.evidence)
    return _first_of_each(every, lambda c: c.terms[-1].variant)


def _best_screened(ranked: list[Term]) -> list[Term]:
    """The best terms, starts of each, and the formulas at the places of the best functions."""
    # The linearised gain of a formula that is far from linear is little at a start that is far from
    # the truth; the function at its place is not misled by that. Nominal physics is fitted in any
    # case.
    variants = by_variant(ranked)
    chosen = [term for own in variants[:TRIED] for term in own[:STARTS]]
    terms = [own[0] for own in variants[TRIED:]]
    functions = [term for term in chosen if term.is_function][:REFITTED]
    chosen += [
        term
        for term in terms
        if not term.is_function and any(term.shares_place(each) for each in functions)
    ]
    chosen += [t for own in variants for t in own if t.is_nominal and t not in chosen]
    return chosen


def _first_of_each[T](ranked: Iterable[T], kind: Callable[[T], Hashable]) -> list[T]:
    """The first one of each kind, in their order."""
    first: dict[Hashable, T] = {}
    for each in ranked:
        first.setdefault(kind(each), each)
    return list(first.values())


def _worth_a_fit(trials: list[tuple[float, Trial]]) -> list[Trial]:
    """The best after a first fit, what is nominal, and all that are at the place of the best."""
    ranked = [seen for _, seen in sorted(trials, key=lambda each: each[0])]
    chosen = ranked[:REFITTED]
    return chosen + [
        seen
        for seen in ranked[REFITTED:]
        if term_of(seen).is_nominal or term_of(seen).shares_place(term_of(chosen[0]))
    ]
