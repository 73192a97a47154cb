"""The search: what one term more explains, as often as that is more than another form could.

At each level all terms are screened by linear algebra, the most promising are fitted in the
simulator, and the evidence ranks them, functions and formulas alike. Rigs in which nothing is
missing, run through the same screen, show how much evidence there is then.

Several recordings of a rig whose tube is bent differently in each keep its physics, and only its
parameters change. Explained one by one, two of them may well be given different names for the same
misfit: they are searched as one, by the sum of the evidence, and fitted together.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

from endoscope_core.physics.effects import lacking
from endoscope_core.workers import parallel_map
from endoscope_explain.fit.evidence import predicts_worse
from endoscope_explain.fit.model import Fit
from endoscope_explain.fit.nominal import is_at_tolerance, with_any_numbers
from endoscope_explain.options import MOST_EFFECTS
from endoscope_explain.search.expansion import (
    Parent,
    Screened,
    before_giving_up,
    expanded,
    first_of_each,
    screen_terms,
)
from endoscope_explain.search.judging import (
    FALSE_ALARMS,
    BesideNullRigs,
    InRecordingsLeftOut,
    Judge,
)
from endoscope_explain.search.left_out import LEAST_RECORDINGS
from endoscope_explain.search.null_rigs import NO_DETECTABLE_GAIN, null_of_several, null_rigs
from endoscope_explain.search.pairs import better_pair
from endoscope_explain.search.refit import Candidate, by_fine_derivatives, candidate, converged
from endoscope_explain.search.term import Known, Term

MOST_FITS, WORTH_A_FIT = 6, 1.0
"""Fits of what every rig has, without which all other numbers were bent, and the gain of evidence
in nats that is worth another one."""
PARENTS = 2
"""Candidates that are added to."""
NOT_JUDGED = BesideNullRigs(NO_DETECTABLE_GAIN)
"""Where no term moves anything."""


@dataclass(frozen=True)
class Level:
    """Candidates with one term more."""

    parent: Candidate  # the best of those that were added to
    found: tuple[Candidate, ...]  # best first
    judge: Judge = NOT_JUDGED
    # Candidates that explain what they were fitted to, and do not foretell what they were not.
    not_foretelling: tuple[Candidate, ...] = ()

    def gain(self, one: Candidate) -> float:
        """Logarithm of the evidence of a candidate over its parent's."""
        return one.evidence - self.parent.evidence

    @property
    def best(self) -> Candidate:
        """The candidate to go on with."""
        # Other numbers, then nominal physics, and then a formula stand where nothing
        # distinguishes the best one from them.
        top = self.found[0]

        def first(candidates: Iterable[Candidate]) -> Candidate | None:
            return next((c for c in candidates if self.judge.stands_for(c, top)), None)

        stands = first(c for c in self.found if self.adds_nothing(c) and self.gain(c) > 0.0)
        stands = stands or first(c for c in self.found if c.terms and c.terms[-1].is_nominal)
        if stands is None and not self.adds_nothing(top) and top.terms[-1].is_function:
            formulas = (c for c in self.at_the_place_of(top) if not c.terms[-1].is_function)
            stand = (c for c in formulas if self.judge.formula_stands(c, top, self.parent))
            stands = next(stand, None)
        return stands or top

    def adds_nothing(self, one: Candidate) -> bool:
        """Whether a candidate has other numbers than its parent, and no term more."""
        return len(one.terms) == len(self.parent.terms)

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

    def beside(self, terms: Iterable[Term]) -> list[tuple[Term, Candidate]]:
        """Candidates that have some terms and one more, and which one that is."""
        there = sorted(term.id for term in terms)
        found = ((_one_more(each, there), each) for each in self.found)
        return [(more, each) for more, each in found if more is not None]

    @property
    def p_value(self) -> float:
        """Chance that nothing is missing where the best candidate gains so much."""
        return self.judge.p_value(self.best, self.parent) if self.found else 1.0

    @property
    def is_found(self) -> bool:
        """Whether something is missing, and found."""
        return bool(self.found) and self.judge.confirms(self.best, self.parent)

    def variants(self) -> tuple[Candidate, ...]:
        """The best candidate's effects acting on something else: beside another they may win."""
        ids = [term.id for term in self.best.terms]
        return tuple(
            c for c in self.found if c is not self.best and [term.id for term in c.terms] == ids
        )

    def rivals(self) -> tuple[Candidate, ...]:
        """Candidates that are confounded with the first one."""
        top = self.found[0]
        others = (c for c in self.found if c is not self.best)
        return tuple(c for c in others if c is top or self.judge.stands_for(c, top))


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
        return [
            self.nominal,
            *(c for level in self.levels for c in (*level.found, *level.not_foretelling)),
        ]


def search(
    recordings: Sequence[tuple[Fit, ...]],
    jobs: int,
    depth: int = MOST_EFFECTS,
    left_out: tuple[str, ...] = (),
    known: Known | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> JointSearch:
    """Search what is missing from a joint: `depth` terms at most beside nominal physics."""
    # Of each recording there is the nominal plant refitted, and as described if given. In several
    # of a rig only effects are searched: a function has the range of one motion. What is `known`,
    # by name, from other recordings is fitted in any case.
    nominal = candidate((), *(references[0] for references in recordings))
    joint = nominal.fits[0].model.observation.joint
    depth += sum(each.in_every_rig for each in lacking(nominal.fits[0].model.base))
    if not nominal.is_noise:
        # What only the numbers are still worth is no gain of a term.
        nominal = converged(converged(nominal))
    beside = zip(nominal.fits, recordings, strict=True)
    parents = [Parent(nominal, tuple((found, *described) for found, (_, *described) in beside))]
    levels: list[Level] = []
    first: Screened | None = None  # of the last candidate that has only what every rig has
    while len(parents[0].candidate.terms) < depth and not parents[0].candidate.is_noise:
        changed = any(each.adds_nothing(each.best) for each in levels)
        screens = [screen_terms(parent, jobs, left_out, known or {}) for parent in parents]
        if all(term.is_in_every_rig for term in parents[0].candidate.terms):
            first = screens[0]
        level = _level(screens, first, jobs, other_numbers=not changed)
        levels.append(level)
        report(f'{joint}: {_in_words(level)}')
        if not level.is_found:
            break
        best = level.best
        if best.adds_nominal:
            best = _from_afar(best)
            found = tuple(best if c is level.best else c for c in level.found)
            levels[-1] = level = replace(level, found=found)
        # What every rig of this kind has takes the place of all that imitates it.
        stands = level.adds_nothing(best) or best.terms[-1].is_nominal
        others = [] if stands else [*level.variants(), *level.rivals()]
        others = [c for c in others if not level.adds_nothing(c)][: PARENTS - 1]
        parents = [Parent.of(each) for each in (best, *map(converged, others))]
    if parents[0].candidate.is_noise:
        report(f'{joint}: only noise is left beside {_names(parents[0].candidate) or "nothing"}')
    return JointSearch(nominal, tuple(levels))


def _names(one: Candidate) -> str:
    return ', '.join(term.id for term in one.terms)


def _one_more(one: Candidate, there: list[str]) -> Term | None:
    """The term that a candidate has beside some, by their sorted ids; None where it has others."""
    # The last one, unless terms came in another order.
    for k in reversed(range(len(one.terms))):
        if sorted(term.id for term in one.terms[:k] + one.terms[k + 1 :]) == there:
            return one.terms[k]
    return None


def _in_words(level: Level) -> str:
    """What came of a level, in words."""
    if not level.found:
        return 'no term moves anything'
    names = _names(level.best) or 'other numbers'
    gain = level.gain(level.best)
    if level.is_found:
        return f'{names}, better by {gain:.0f} nats'
    doubts = level.judge.doubts(level.best, level.parent)
    return f'not {names}: better by {gain:.0f} nats, but {doubts}'


def _from_afar(one: Candidate) -> Candidate:
    """A candidate whose numbers have far to go, fitted again by what each fit leaves."""
    for _ in range(MOST_FITS):
        again = converged(one)
        if again.evidence - one.evidence < WORTH_A_FIT:
            break
        one = again
    return one


def _level(
    screens: Sequence[Screened], base: Screened | None, jobs: int, *, other_numbers: bool
) -> Level:
    """Candidates with one term more than those that were screened."""
    # `base` is the screen of the last candidate that has no more than every rig has.
    parents = [screen.parent.candidate for screen in screens]
    found = [each for screen in screens for each in expanded(screen, jobs)]
    found += [
        converged(candidate(parent.terms, *map(with_any_numbers, parent.fits)))
        for parent in parents
        if other_numbers and any(map(is_at_tolerance, parent.fits))
    ]
    found += _of_other_pairs(parents[0], base, found, jobs)
    level = _judged(parents[0], found, screens[0], jobs)
    if not (level.is_found or (level.found and level.found[0].is_noise)):
        others = before_giving_up(screens[0], found, jobs)
        if all(each.evidence < level.found[0].evidence for each in others):
            level = replace(level, found=_ranked([*level.found, *others]))
        else:
            level = _judged(parents[0], [*found, *others], screens[0], jobs)
    return level


def _of_other_pairs(
    parent: Candidate, base: Screened | None, found: Sequence[Candidate], jobs: int
) -> list[Candidate]:
    """Candidates beside another first term, where a pair of the screen's has more evidence."""
    if base is None or len(parent.fits) > 1:
        return []
    if len(parent.terms) != len(base.parent.candidate.terms) + 1:
        return []
    pairs = [c for c in found if len(c.terms) > len(parent.terms)]
    better = better_pair(base, pairs, jobs)
    if better is None:
        return []
    first, both = better
    screen = screen_terms(first, jobs, base.left_out, base.known)
    return [both, *expanded(screen, jobs)]


def _judged(first: Candidate, found: list[Candidate], screen: Screened, jobs: int) -> Level:
    """Candidates beside rigs in which nothing is missing, or beside recordings left out."""
    ranked = _ranked(found)
    if not ranked:
        return Level(first, ())
    if len(first.fits) >= LEAST_RECORDINGS:
        left_out_of = InRecordingsLeftOut()
        settled = parallel_map(converged, ranked, jobs)
        return Level(first, left_out_of.ranked(tuple(settled), first), left_out_of)
    if not ranked[0].is_noise:
        ranked = (by_fine_derivatives(ranked[0]), *ranked[1:])
    foretelling, others = _foretelling(first, ranked)
    level = Level(first, foretelling, not_foretelling=others)
    judge = _beside_nothing_missing(level, screen, jobs)
    best = replace(level, judge=judge).best
    return replace(level, judge=replace(judge, predicts=_foretells(best, first)))


def _ranked(found: list[Candidate]) -> tuple[Candidate, ...]:
    """Candidates by their evidence, the best first, each combination of terms once."""
    best_first = sorted(found, key=lambda c: -c.evidence)
    return tuple(first_of_each(best_first, lambda c: frozenset(t.variant for t in c.terms)))


def _foretelling(
    first: Candidate, ranked: tuple[Candidate, ...]
) -> tuple[tuple[Candidate, ...], tuple[Candidate, ...]]:
    """Candidates, best first, that foretell what was held out, and those that do not."""
    # What leaves noise alone is what is missing. What leaves more is one of many forms that bend
    # towards it, and evidence is largest for those that bend most: a length that is free to change
    # with time follows every branch of a loop, and shows nothing of the next one.
    if ranked[0].is_noise or len(first.fits) > 1:
        return ranked, ()
    worth = [c for c in ranked if c.evidence > first.evidence]
    leading = list(takewhile(lambda c: not _foretells(c, first), worth))
    if len(leading) == len(worth):
        return ranked, ()
    stand_ins = [c for c in worth if _may_stand(c, first) and not _foretells(c, first)]
    aside = {id(c) for c in (*leading, *stand_ins)}
    found = tuple(c for c in ranked if id(c) not in aside)
    return found, tuple(c for c in ranked if id(c) in aside)


def _may_stand(one: Candidate, first: Candidate) -> bool:
    """Whether a candidate may stand for a better one; see `Level.best`."""
    return len(one.terms) == len(first.terms) or one.terms[-1].is_nominal


def _foretells(one: Candidate, first: Candidate) -> bool:
    """Whether a candidate predicts better what it has not seen, and no signal worse."""
    if one.unseen_misfit >= first.unseen_misfit:
        return False
    return not any(
        predicts_worse(fit.model.observation, before, after)
        for fit, before, after in zip(one.fits, first.unseen, one.unseen, strict=True)
    )


def _beside_nothing_missing(level: Level, screen: Screened, jobs: int) -> BesideNullRigs:
    """What rigs show in which nothing is missing."""
    top = level.found[0]
    if len(screen.behind) > 1:
        gain = level.gain(top)
        return BesideNullRigs(null_of_several(screen.behind, screen.ways, top.fits, gain, jobs))
    rigs = null_rigs(screen.behind[0], screen.ways[0], top.fit, jobs)
    if rigs is None:
        return NOT_JUDGED
    judge = BesideNullRigs(rigs.as_screened())
    best = replace(level, judge=judge).best
    if best.adds_nominal:
        return judge
    if not level.adds_nothing(best) and best.terms[-1].is_nominal:
        # It is one hypothesis that was there before the data, and not the best of many.
        rigs = rigs.of(best.terms[-1].id)
    null = rigs.beside(level.gain(best), FALSE_ALARMS, jobs)
    return BesideNullRigs(replace(null, doubt=judge.null.doubt))
