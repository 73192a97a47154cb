"""Prediction sets of an explanation: whether they contain the truth, and how large they are."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.explanation import Explanation
from endoscope_explain.prediction_set import NOTHING, OTHER_NUMBERS, Contest
from endoscope_lab.concealed.judge import Case, Law, is_of


@dataclass(frozen=True)
class JudgedContest:
    """Names that were tried for one missing term of a rig whose truth is known."""

    contest: Contest
    joint: str
    reported: str  # the name that was reported; NOTHING or OTHER_NUMBERS where none was
    # For each of the names, for nothing, and for something else.
    right: tuple[bool, ...]

    @property
    def statements(self) -> list[tuple[tuple[str, ...], bool]]:
        """Each statement, and whether it is right."""
        return list(zip(self.contest.statements, self.right, strict=True))

    @property
    def reported_is_right(self) -> bool:
        """Whether the reported name is right."""
        return any(right and self.reported in names for names, right in self.statements)

    @property
    def is_of_function(self) -> bool:
        """Whether an effect was reported, and a function at its place is right."""
        places = _families(self.reported)
        return any(right and bool(places & set(names)) for names, right in self.statements)

    @property
    def holds(self) -> bool:
        """Whether the prediction set contains the truth."""
        left = self.contest.left_open(self.reported)
        return any(right and names in left for names, right in self.statements)

    @property
    def size(self) -> int:
        """Names in the prediction set; a function at a place counts for all formulas there."""
        left = list(self.contest.left_open(self.reported))
        places = {name for names in left for name in names}
        return sum(not any(_families(name) & places for name in names) for names in left) or 1

    def kept(self) -> dict[str, object]:
        """Return the contest as a row stores it."""
        return asdict(self)

    @staticmethod
    def of_row(kept: dict[str, object]) -> 'JudgedContest':
        """Read what a row stores."""
        fields: dict[str, object] = dict(kept['contest'])  # type: ignore[call-overload]
        fields['names'] = tuple(map(tuple, fields['names']))  # type: ignore[call-overload]
        fields['gains'] = tuple(fields['gains'])  # type: ignore[arg-type]
        return JudgedContest(
            Contest(**fields),  # type: ignore[arg-type]
            str(kept['joint']),
            str(kept['reported']),
            tuple(kept['right']),  # type: ignore[arg-type]
        )


def all_hold(contests: Sequence[JudgedContest]) -> bool:
    """Whether every prediction set of a case contains the truth."""
    return all(each.holds for each in contests)


def all_are_reported(contests: Sequence[JudgedContest], laws: Sequence[Law]) -> bool:
    """Whether every law is confounded, in its recording, with a name reported on its joint."""

    def is_reported(law: Law) -> bool:
        return any(
            is_of(name, each.joint, law)
            for each in contests
            for names in each.contest.names
            if each.reported in names
            for name in names
        )

    return bool(laws) and all(map(is_reported, laws))


def mean_size(contests: Sequence[JudgedContest]) -> float:
    """Mean size of the prediction sets of a case; one where only noise was left."""
    return float(np.mean([each.size for each in contests])) if contests else 1.0


def judged_contests(
    case: Case, explanation: Explanation, identifiable: Sequence[Law]
) -> tuple[JudgedContest, ...]:
    """Names that were tried for each missing term, compared with the truth.

    Laws that are not `identifiable` are confounded with other numbers of the rig.
    """
    found = list(_contests(explanation))
    named = [(name, joint) for name, joint, _ in found if name not in (NOTHING, OTHER_NUMBERS)]
    return tuple(
        JudgedContest(contest, joint, name, _right(case, identifiable, named, name, joint, contest))
        for name, joint, contest in found
    )


def _contests(explanation: Explanation) -> Iterator[tuple[str, str, Contest]]:
    for effect in explanation.effects:
        if effect.contest is not None:
            yield effect.id, effect.joint, effect.contest
    term = explanation.unknown
    if term is not None and not term.siblings and term.contest is not None:
        yield term.place, term.joint, term.contest
    for joint, contest in explanation.contests.items():
        yield contest.nameless, joint, contest


def _right(
    case: Case,
    identifiable: Sequence[Law],
    named: Sequence[tuple[str, str]],
    name: str,
    joint: str,
    contest: Contest,
) -> tuple[bool, ...]:
    # A law that another statement names is not counted again.
    others = [each for each in named if each != (name, joint)]
    left = [
        law
        for law in case.laws
        if law.joint in ('', joint) and not any(is_of(*each, law) for each in others)
    ]
    here = [law for law in left if law in identifiable]

    def of_a_law(one: str) -> bool:
        if one == OTHER_NUMBERS:
            return not here
        return any(is_of(one, joint, law) for law in left) or _is_form(one, case.also)

    right = [any(map(of_a_law, names)) for names in contest.names]
    return *right, not here, bool(here) and not any(right)


def _is_form(name: str, also: Collection[str]) -> bool:
    """Whether a name describes the form of the rig itself."""
    return name in also or bool(_families(name) & set(also))


def _families(name: str) -> set[str]:
    return set(CATALOGUE[name].traits.families) if name in CATALOGUE else set()
