"""Candidates with one term more: screened, tried by few simulations, fitted until they stand."""

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from endoscope_core.physics.effect import Traits
from endoscope_core.workers import parallel_map
from endoscope_explain.fit.family import family_at
from endoscope_explain.fit.model import Fit
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.observe.revisits import motion_repeats
from endoscope_explain.search.left_out import LEAST_RECORDINGS, repeat_one_motion
from endoscope_explain.search.null_rigs import NEAR
from endoscope_explain.search.refit import (
    Candidate,
    TrialFit,
    begun_beside,
    converged,
    cost_before,
    refined,
    refit,
    term_of,
    trial_fit,
)
from endoscope_explain.search.screen import (
    Background,
    Directions,
    background,
    by_variant,
    directions,
    screened,
)
from endoscope_explain.search.term import Known, Term, Variant, begun_as_before, effects, functions

TRIED, REFITTED = 10, 4
"""Terms that get a first fit and a full one: in the study the truth was among the first three of
the screen in 46 cases of 48, and among the first five in 47. On 15 joints of development cases it
was third or better by screen and by first fit; two full fits give one of these a wrong name."""
STARTS = 2
"""Starting points of each: far from linear, that of the largest linearised gain may fit least; one
or four give the same names."""
REFINED = 3
"""Functions of these, the best, that are let vary faster."""
SETTLED = 2
"""Of these the best ones and those at the place of the best are fitted until they stand."""


@dataclass(frozen=True)
class Parent:
    """A candidate that is added to."""

    candidate: Candidate
    # Of each recording, the candidate's fit, and others from which a trial fit may begin.
    references: tuple[tuple[Fit, ...], ...]

    @classmethod
    def of(cls, candidate: Candidate) -> 'Parent':
        """With its own fits alone."""
        return cls(candidate, tuple((own,) for own in candidate.fits))


@dataclass(frozen=True)
class Screened:
    """Terms that may be added to a candidate, of each recording."""

    parent: Parent
    behind: tuple[Background, ...]
    ways: tuple[tuple[Directions, ...], ...]
    known: Known
    left_out: tuple[str, ...] = ()  # effects that are not searched for


def screen_terms(parent: Parent, jobs: int, left_out: tuple[str, ...], known: Known) -> Screened:
    """What each term moves that the parent's own numbers cannot take away."""
    behind = tuple(background(found) for found in parent.candidate.fits)
    terms = [(*begun_as_before(own, known), *own) for own in _terms(behind, left_out)]
    ways = tuple(directions(b, own, jobs) for b, own in zip(behind, terms, strict=True))
    return Screened(parent, behind, _of_one_size(ways), known, left_out)


def _terms(behind: Sequence[Background], left_out: tuple[str, ...]) -> list[tuple[Term, ...]]:
    """What may be missing from the joint, of each recording."""
    if len(behind) == 1:
        return [addable(behind[0], left_out)]
    # Another motion does not distinguish what was fitted to one from time, nor time from what
    # depends on a motion that is the same in all of them.
    always = repeat_one_motion([each.fit.model.observation for each in behind])

    def told_from_time(traits: Traits, observation: JointObservation) -> bool:
        if traits.depends_on_time and always:
            return False
        return not traits.resembles_time or motion_repeats(observation)

    found = [
        [
            term
            for term in effects(each.fit, left_out)
            if told_from_time(term.effect.traits, each.fit.model.observation)
        ]
        for each in behind
    ]
    everywhere = set.intersection(*({term.id for term in terms} for terms in found))
    shared = _shared_functions(behind, told_from_time)
    return [(*(term for term in terms if term.id in everywhere), *shared) for terms in found]


def _shared_functions(
    behind: Sequence[Background], told_from_time: Callable[[Traits, JointObservation], bool]
) -> list[Term]:
    """Functions of states that all recordings visit, over the range that they visit together."""
    # That two recordings share a function nothing confirms. Of a period or a lag each would have
    # its own.
    if len(behind) < LEAST_RECORDINGS:
        return []
    visited: list[dict[str, Term]] = []
    for each in behind:
        observation = each.fit.model.observation
        of_one = functions(each.fit, each.left(each.fit.residuals * each.weight))
        visited.append(
            {
                term.id: term
                for term in of_one
                if term.family is not None
                and term.family.band is None
                and not term.multiplies
                and told_from_time(term.effect.traits, observation)
            }
        )
    shared = []
    for name in sorted(set.intersection(*map(set, visited))):
        families = [own[name].family for own in visited]
        low = min(each.low for each in families if each is not None)
        high = max(each.high for each in families if each is not None)
        first = visited[0][name]
        assert first.family is not None
        if (family := family_at(first.family.place, (low, high))) is not None:
            shared.append(replace(first, family=family))
    return shared


def _of_one_size(ways: tuple[tuple[Directions, ...], ...]) -> tuple[tuple[Directions, ...], ...]:
    """Directions in which a function is drawn as large in each recording."""
    if len(ways) == 1:
        return ways
    sizes: dict[str, list[float]] = {}
    for way in chain(*ways):
        if way.term.family is not None:
            sizes.setdefault(way.term.id, []).append(way.term.family.size)
    common = {name: float(np.exp(np.mean(np.log(own)))) for name, own in sizes.items()}

    def scaled(way: Directions) -> Directions:
        family = way.term.family
        if family is None:
            return way
        factor = common[way.term.id] / family.size
        term = replace(way.term, family=family.scaled(factor))
        return replace(way, term=term, columns=factor * way.columns)

    return tuple(tuple(map(scaled, own)) for own in ways)


def addable(behind: Background, left_out: tuple[str, ...]) -> tuple[Term, ...]:
    """What may be missing from the joint of one recording."""
    left = behind.left(behind.fit.residuals * behind.weight)
    return (*effects(behind.fit, left_out), *functions(behind.fit, left))


Trial = tuple[TrialFit | None, ...]
"""A term's first fit to each recording; None where that has no use for it."""


def expanded(screen: Screened, jobs: int) -> list[Candidate]:
    """The parent with one term more, the best first."""
    parent = screen.parent.candidate
    likely = [
        _likely(*each, screen.known, jobs)
        for each in zip(screen.behind, screen.ways, screen.parent.references, strict=True)
    ]
    chosen = _worth_a_fit(_trials(screen, likely, jobs), screen.known)
    grown = parallel_map(lambda seen: refit(seen, parent), chosen, jobs)
    grown.sort(key=lambda c: -c.evidence)
    if grown and not grown[0].is_noise and len(parent.fits) == 1:
        grown = _with_finer_functions(grown, screen, jobs)
        grown = _with_their_formulas(grown, screen, jobs)
    return _settled(grown, jobs)


def before_giving_up(screen: Screened, found: Sequence[Candidate], jobs: int) -> list[Candidate]:
    """The formulas that the screen puts first, of all and of each part of the chain."""
    # Beside numbers that are bent by what is missing, a first fit of few simulations may lead
    # nowhere where a full one finds what the screen has seen.
    parent = screen.parent.candidate
    there = {each.terms[-1].variant for each in found if each.terms}
    likely = []
    for behind, ways in zip(screen.behind, screen.ways, strict=True):
        ranked = [term for term in screened(behind, ways) if not term.is_function]
        variants = by_variant(ranked)
        first = variants[:REFITTED] + first_of_each(variants, lambda own: own[0].effect.stage)
        chosen = first_of_each(first, lambda own: own[0].variant)
        likely.append([t for own in chosen for t in own[:STARTS] if t.variant not in there])
    new = [seen for _, seen in _trials(screen, likely, jobs)]
    return parallel_map(lambda seen: converged(refit(seen, parent)), new, jobs)


def _trials(screen: Screened, likely: list[list[Term]], jobs: int) -> list[tuple[float, Trial]]:
    """First fits of likely terms, with the sum of the logarithms of their costs, best first."""
    references = screen.parent.references
    if len(likely) > 1:
        # What one recording makes likely is tried in all of them.
        likely = [_with_those_of(likely, *own) for own in zip(likely, screen.ways, strict=True)]
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
    # Of several recordings, one stays without a term that is of no use to it.
    several = len(references) > 1
    without = [cost_before(found) if several else math.inf for found, *_ in references]
    trials = []
    for own in best.values():
        used = tuple(
            seen if seen is not None and seen.cost < cost else None
            for seen, cost in zip(own, without, strict=True)
        )
        costs = [c if seen is None else seen.cost for seen, c in zip(used, without, strict=True)]
        if any(seen is not None for seen in used):
            trials.append((sum(map(math.log, costs)), used))
    return sorted(trials, key=lambda each: each[0])


def _with_those_of(
    all_of_them: Sequence[list[Term]], own: list[Term], ways: tuple[Directions, ...]
) -> list[Term]:
    """Terms of one recording, and one start of each that is likely in another."""
    missing = {term.variant for term in chain(*all_of_them)} - {term.variant for term in own}
    starts = [way.term for way in ways if way.term.variant in missing]
    return own + first_of_each(starts, lambda term: term.variant)


def _likely(
    behind: Background,
    ways: tuple[Directions, ...],
    references: tuple[Fit, ...],
    known: Known,
    jobs: int,
) -> list[Term]:
    """Terms of one recording that are worth a first fit."""
    likely = _best_screened(screened(behind, ways))
    there = {term.variant for term in likely}
    # The first of its starts is the one at the numbers that it had.
    again = [way.term for way in ways if way.term.id in known]
    likely += first_of_each((t for t in again if t.variant in there), lambda t: t.variant)
    likely += [term for term in again if term.variant not in there]
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


def _with_finer_functions(grown: list[Candidate], screen: Screened, jobs: int) -> list[Candidate]:
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


def _with_their_formulas(grown: list[Candidate], screen: Screened, jobs: int) -> list[Candidate]:
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
    return first_of_each(every, lambda c: c.terms[-1].variant)


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


def first_of_each[T](ranked: Iterable[T], kind: Callable[[T], Hashable]) -> list[T]:
    """The first one of each kind, in their order."""
    first: dict[Hashable, T] = {}
    for each in ranked:
        first.setdefault(kind(each), each)
    return list(first.values())


def _worth_a_fit(trials: list[tuple[float, Trial]], known: Known) -> list[Trial]:
    """The best after a first fit, what is nominal or known, and all at the place of the best."""
    ranked = [seen for _, seen in trials]
    chosen = ranked[:REFITTED]
    return chosen + [
        seen
        for seen in ranked[REFITTED:]
        if term_of(seen).is_nominal
        or term_of(seen).id in known
        or term_of(seen).shares_place(term_of(chosen[0]))
    ]
