"""How far the names that an explanation leaves open hold the truth, and how many they are."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.explanation import Explanation
from endoscope_explain.prediction_set import NOTHING, OTHER_NUMBERS, SOMETHING_ELSE, Contest
from endoscope_lab.concealed.judge import Case, Law, is_of


@dataclass(frozen=True)
class JudgedContest:
    """Names that were tried in one place of a rig whose truth is known."""

    contest: Contest
    joint: str
    said: str  # the name that was given; nothing, or other numbers, where none was
    # Of each of the names, of nothing, and of something else.
    right: tuple[bool, ...]

    @property
    def said_is_right(self) -> bool:
        """Whether the name that was given is right."""
        every = [*self.contest.names, (NOTHING,), (SOMETHING_ELSE,)]
        return any(
            right and self.said in names for names, right in zip(every, self.right, strict=True)
        )

    @property
    def is_of_function(self) -> bool:
        """Whether an effect was named, and a function at its place is right."""
        places = _families(self.said)
        every = zip(self.contest.names, self.right, strict=False)
        return any(right and bool(places & set(names)) for names, right in every)

    @property
    def holds(self) -> bool:
        """Whether the set that is left open holds the truth."""
        left = self.contest.left_open(self.said)
        every = [*self.contest.names, (NOTHING,), (SOMETHING_ELSE,)]
        return any(right and each in left for each, right in zip(every, self.right, strict=True))

    @property
    def size(self) -> int:
        """Statements that are left open: a function at a place holds the formulas of that place."""
        left = list(self.contest.left_open(self.said))
        places = {name for names in left for name in names}
        return sum(not any(_families(name) & places for name in names) for names in left) or 1

    def kept(self) -> dict[str, object]:
        """As a row keeps it."""
        return asdict(self)

    @staticmethod
    def of_row(kept: dict[str, object]) -> 'JudgedContest':
        """What a row kept."""
        fields: dict[str, object] = dict(kept['contest'])  # type: ignore[call-overload]
        fields['names'] = tuple(map(tuple, fields['names']))  # type: ignore[call-overload]
        fields['gains'] = tuple(fields['gains'])  # type: ignore[arg-type]
        return JudgedContest(
            Contest(**fields),  # type: ignore[arg-type]
            str(kept['joint']),
            str(kept['said']),
            tuple(kept['right']),  # type: ignore[arg-type]
        )


def all_hold(contests: Sequence[JudgedContest]) -> bool:
    """Whether every set of a case holds the truth."""
    return all(each.holds for each in contests)


def all_are_said(contests: Sequence[JudgedContest], laws: Sequence[Law]) -> bool:
    """Whether every law is one, in its recording, with what is said on its joint."""

    def said(law: Law) -> bool:
        return any(
            is_of(name, each.joint, law)
            for each in contests
            for names in each.contest.names
            if each.said in names
            for name in names
        )

    return bool(laws) and all(map(said, laws))


def mean_size(contests: Sequence[JudgedContest]) -> float:
    """Statements that a set of a case leaves open; one where only noise was left."""
    return float(np.mean([each.size for each in contests])) if contests else 1.0


def judged_contests(
    case: Case, said: Explanation, told: Sequence[Law]
) -> tuple[JudgedContest, ...]:
    """What was tried for each thing that may be missing, beside the truth.

    Laws that are not `told` from other numbers are one with these.
    """
    found = list(_contests(said))
    named = [(name, joint) for name, joint, _ in found if name not in (NOTHING, OTHER_NUMBERS)]
    return tuple(
        JudgedContest(contest, joint, name, _right(case, told, named, name, joint, contest))
        for name, joint, contest in found
    )


def _contests(said: Explanation) -> Iterator[tuple[str, str, Contest]]:
    for effect in said.effects:
        if effect.contest is not None:
            yield effect.id, effect.joint, effect.contest
    term = said.unknown
    if term is not None and not term.siblings and term.contest is not None:
        yield term.place, term.joint, term.contest
    for joint, contest in said.contests.items():
        yield contest.nameless, joint, contest


def _right(
    case: Case,
    told: Sequence[Law],
    named: Sequence[tuple[str, str]],
    name: str,
    joint: str,
    contest: Contest,
) -> tuple[bool, ...]:
    # A law that another statement names is no second one.
    others = [each for each in named if each != (name, joint)]
    left = [
        law
        for law in case.laws
        if law.joint in ('', joint) and not any(is_of(*each, law) for each in others)
    ]
    here = [law for law in left if law in told]

    def of_a_law(one: str) -> bool:
        if one == OTHER_NUMBERS:
            return not here
        return any(is_of(one, joint, law) for law in left) or _is_form(one, case.also)

    right = [any(map(of_a_law, names)) for names in contest.names]
    return *right, not here, bool(here) and not any(right)


def _is_form(name: str, also: Collection[str]) -> bool:
    """Whether a name is of the form of the rig itself."""
    return name in also or bool(_families(name) & set(also))


def _families(name: str) -> set[str]:
    return set(CATALOGUE[name].traits.families) if name in CATALOGUE else set()
