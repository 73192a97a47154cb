"""The search: what one term more explains, as often as that is more than another form could.

At each level all terms are screened by linear algebra, the most promising are fitted in the
simulator, and the evidence ranks them, functions and formulas alike. Rigs in which nothing is
missing, run through the same screen, say how much evidence there is then.
"""

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from endoscope_core.physics.effects import lacking
from endoscope_explain.fit.evidence import is_noise, log_evidence
from endoscope_explain.fit.intervals import with_form
from endoscope_explain.fit.model import Fit
from endoscope_explain.fit.nominal import is_at_tolerance, with_any_numbers
from endoscope_explain.parallel import parallel_map
from endoscope_explain.search.null_rigs import NEAR, NO_DETECTABLE_GAIN, Null, null_rigs
from endoscope_explain.search.refit import (
    Candidate,
    TrialFit,
    begun_beside,
    by_fine_derivatives,
    candidate,
    converged,
    refined,
    refit,
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
from endoscope_explain.search.term import (
    Term,
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
    """What was tried on one joint."""

    nominal: Candidate  # no term added
    # With one, two, ... terms; the last one may have found nothing.
    levels: tuple[Level, ...]

    def tried(self) -> list[Candidate]:
        """All candidates, the one without any term first."""
        return [self.nominal, *(c for level in self.levels for c in level.found)]


def search(
    references: tuple[Fit, ...],
    jobs: int,
    depth: int = MOST_EFFECTS,
    left_out: tuple[str, ...] = (),
) -> JointSearch:
    """Search what is missing from a joint: `depth` terms at most beside nominal physics."""
    # References are the nominal plant refitted, and as described if given.
    nominal = candidate((), references[0])
    depth += len(lacking(references[0].model.base))
    if not is_noise(nominal.fit):
        # What only the numbers are still worth is no gain of a term.
        nominal = converged(converged(nominal))
    parents: list[tuple[Candidate, tuple[Fit, ...]]] = [(nominal, (nominal.fit, *references[1:]))]
    levels: list[Level] = []
    while len(parents[0][0].terms) < depth and not is_noise(parents[0][0].fit):
        described = not any(each.adds_nothing(each.best) for each in levels)
        level = _level(parents, jobs, left_out, other_numbers=described)
        levels.append(level)
        if not level.is_found:
            break
        best = level.best
        if best.adds_nominal:
            best = _from_afar(best)
        best = replace(best, fit=with_form(best.fit, jobs))
        found = tuple(best if c is level.best else c for c in level.found)
        levels[-1] = level = replace(level, found=found)
        as_another_form = best.fit.beyond_form is not None and best.fit.beyond_form <= 1.0
        if as_another_form and not level.adds_nothing(best):
            # Rigs of another form, in which nothing more is missing, leave as much.
            break
        others = [] if level.adds_nothing(best) else [*level.variants(), *level.rivals()]
        others = [c for c in others if not level.adds_nothing(c)][: PARENTS - 1]
        parents = [(each, (each.fit,)) for each in (best, *map(converged, others))]
    return JointSearch(nominal, tuple(levels))


def _from_afar(one: Candidate) -> Candidate:
    """A candidate whose numbers have far to go, fitted again by what each fit leaves."""
    for _ in range(MOST_FITS):
        again = converged(one)
        if again.evidence - one.evidence < WORTH_A_FIT:
            break
        one = again
    return one


def _level(
    parents: Sequence[tuple[Candidate, tuple[Fit, ...]]],
    jobs: int,
    left_out: tuple[str, ...],
    *,
    other_numbers: bool,
) -> Level:
    first, _ = parents[0]
    grown = [_grown(parent, references, jobs, left_out) for parent, references in parents]
    found = [each for _, _, candidates in grown for each in candidates]
    found += [
        converged(candidate(parent.terms, with_any_numbers(parent.fit)))
        for parent, _ in parents
        if other_numbers and is_at_tolerance(parent.fit)
    ]
    found.sort(key=lambda c: -c.evidence)
    ranked = tuple(_first_of_each(found, lambda c: frozenset(term.variant for term in c.terms)))
    if not ranked:
        return Level(first, (), NO_DETECTABLE_GAIN)
    ranked = _that_predict(ranked, first)
    if not is_noise(ranked[0].fit):
        ranked = (by_fine_derivatives(ranked[0]), *ranked[1:])
    behind, ways, _ = grown[0]
    rigs = null_rigs(behind, ways, ranked[0].fit, jobs)
    level = Level(first, ranked, rigs.as_screened() if rigs else NO_DETECTABLE_GAIN)
    if rigs and not level.best.adds_nominal:
        level = replace(level, null=rigs.beside(level.gain(level.best), FALSE_ALARMS, jobs))
    return replace(level, predicts=level.best.unseen_misfit < first.unseen_misfit)


def _that_predict(ranked: tuple[Candidate, ...], first: Candidate) -> tuple[Candidate, ...]:
    """Candidates, best first, from the first one on that predicts blocks better than its parent."""
    # A function of time can be anything: what it gains where it was fitted it loses where it was
    # not.
    for k, each in enumerate(ranked):
        if each.evidence > first.evidence and each.unseen_misfit < first.unseen_misfit:
            return ranked[k:]
    return ranked


def _grown(
    parent: Candidate, references: tuple[Fit, ...], jobs: int, left_out: tuple[str, ...]
) -> tuple[Background, tuple[Directions, ...], list[Candidate]]:
    behind = background(parent.fit)
    left = behind.left(behind.fit.residuals * behind.weight)
    terms = (*effects(parent.fit, left_out), *functions(parent.fit, left))
    ways = directions(behind, terms, jobs)
    likely = _best_screened(screened(behind, ways))
    for described in references[1:]:
        # What is missing has bent the fitted numbers, but not the described ones.
        unbent = background(described)
        terms = tuple(way.term for way in ways if not way.term.is_function)
        more = _best_screened(screened(unbent, directions(unbent, terms, jobs)))
        likely += [term for term in more if term.variant not in {t.variant for t in likely}]
    trials = parallel_map(lambda term: trial_fit(references, term, behind.offset), likely, jobs)
    chosen = _worth_a_fit(trials)
    grown = parallel_map(lambda seen: refit(seen, parent), chosen, jobs)
    grown.sort(key=lambda c: -c.evidence)
    if grown and not is_noise(grown[0].fit):
        grown = _with_finer_functions(grown, behind, jobs)
        grown = _with_their_formulas(grown, parent, behind, [way.term for way in ways], jobs)
    return behind, ways, _settled(grown, jobs)


def _settled(grown: list[Candidate], jobs: int) -> list[Candidate]:
    """The best candidates, and those at the place of the best, fitted until they stand."""
    waiting, settled = list(grown), list[Candidate]()
    while waiting and waiting[0] is max([*settled, *waiting], key=lambda c: c.evidence):
        now = waiting[:SETTLED]
        now += [c for c in waiting[SETTLED:] if c.terms[-1].shares_place(now[0].terms[-1])]
        waiting = [c for c in waiting if all(c is not each for each in now)]
        settled += parallel_map(converged, now, jobs)
    return [*settled, *waiting]


def _with_finer_functions(grown: list[Candidate], behind: Background, jobs: int) -> list[Candidate]:
    """Candidates, best first, whose best functions are as fine as there is evidence for."""
    functions = [c for c in _near_the_best(grown, behind) if c.terms[-1].is_function][:REFINED]
    rest = [c for c in grown if all(c is not each for each in functions)]
    finer = parallel_map(lambda c: refined(c, behind.fit, behind.offset), functions, jobs)
    return sorted([*finer, *rest], key=lambda c: -c.evidence)


def _near_the_best(grown: list[Candidate], behind: Background) -> list[Candidate]:
    """Candidates, best first, that may yet become the best one."""
    without = log_evidence(behind.fit)
    least = NEAR * (grown[0].evidence - without)
    return [c for c in grown if c.evidence - without >= least]


def _with_their_formulas(
    grown: list[Candidate],
    parent: Candidate,
    behind: Background,
    terms: list[Term],
    jobs: int,
) -> list[Candidate]:
    """Candidates, best first, with formulas fitted from the numbers that functions leave."""
    # What is missing bends the other numbers, and a formula far from linear, begun beside bent
    # ones, ends anywhere. The function at its place has set them straight.
    tasks: list[tuple[Candidate, list[Term]]] = []
    for function in (c for c in _near_the_best(grown, behind) if c.terms[-1].is_function):
        starts: dict[str, list[Term]] = {}
        for term in terms:
            if not term.is_function and term.shares_place(function.terms[-1]):
                starts.setdefault(term.id, []).append(term)
        tasks += [(function, own) for own in starts.values()]

    def fitted(task: tuple[Candidate, list[Term]]) -> Candidate:
        function, own = task
        return refit(begun_beside(function.fit, parent.fit, own, behind.offset), parent)

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


def _worth_a_fit(trials: list[TrialFit]) -> list[TrialFit]:
    """The best after a first fit, what is nominal, and all that are at the place of the best."""
    trials = sorted(trials, key=lambda seen: seen.cost)
    ranked = _first_of_each(trials, lambda seen: seen.term.variant)
    chosen = ranked[:REFITTED]
    return chosen + [
        seen
        for seen in ranked[REFITTED:]
        if seen.term.is_nominal or seen.term.shares_place(chosen[0].term)
    ]
