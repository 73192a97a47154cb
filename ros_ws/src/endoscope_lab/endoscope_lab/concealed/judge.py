"""What is injected in a case, what its explanation reports, and when the report is right."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations

from endoscope_core.physics import PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_explain.explanation import Explanation, Verdict
from endoscope_explain.recording import RigRecording


@dataclass(frozen=True)
class Law:
    """An injected law, and the names that count as right for it."""

    name: str  # effect, or place of the law
    joint: str  # on which it acts; empty where it acts on all
    stage: str  # of the chain
    ids: frozenset[str]  # effects that are right names
    places: frozenset[str]  # places that are right
    is_unknown: bool = False  # "unknown physics" is the right answer, at whatever place


@dataclass(frozen=True)
class Case:
    """A rig as described and as it is, with its recordings."""

    stratum: str
    seed: int
    # The rig as its engineer describes it, the true rig without the laws, and with them.
    described: PlantDescription
    bare: PlantDescription
    true: PlantDescription
    laws: tuple[Law, ...]  # injected; empty for a null case
    recording: RigRecording  # to explain
    second: RigRecording  # of another motion, for validation
    baseline: RigRecording | None = None  # the rig before anything was injected
    left_out: tuple[str, ...] = ()  # effects whose formulas are not tried
    # Effects and places that do not count as false names: the form of the rig itself.
    also: frozenset[str] = frozenset()
    # Change by a law over the signal, in the channel that shows it most; the least of the laws.
    moved: float = 0.0
    note: str = ''  # particulars of the case


def law_of_effect(effect_id: str, joint: str) -> Law:
    """The law that is an effect of the catalogue."""
    effect = CATALOGUE[effect_id]
    return Law(
        effect_id,
        '' if effect.traits.of_device else joint,
        str(effect.stage),
        frozenset({effect_id}),
        frozenset(effect.traits.families),
    )


def law_at_place(place_id: str, joint: str) -> Law:
    """The law of a drawn form at a place; unknown where no effect is of the place's family."""
    ids = effects_at(place_id)
    stage = str(FUNCTIONS[place_id].stage)
    return Law(place_id, joint, stage, ids, frozenset({place_id}), not ids)


def effects_at(place_id: str) -> frozenset[str]:
    """Effects whose formula is one of the functions at a place."""
    return frozenset(e.id for e in CATALOGUE.values() if place_id in e.traits.families)


@dataclass(frozen=True)
class Statement:
    """One thing that an explanation reports as missing."""

    name: str  # effect, or place of an unknown term
    joint: str
    stage: str
    alternatives: tuple[str, ...] = ()  # names that explain the recording as well

    @property
    def places(self) -> frozenset[str]:
        """Places that the name stands for."""
        if self.name in FUNCTIONS:
            return frozenset({self.name})
        return frozenset(CATALOGUE[self.name].traits.families)


@dataclass(frozen=True)
class Correctness:
    """How far the reported statements are right."""

    # The first statements, as many as there are laws, name all laws; of a null case nothing is
    # reported.
    first: bool
    place: bool  # they name the right places
    stage: bool  # they name the right stages of the chain
    exact: bool  # all laws are named first, and nothing else is reported
    false: int  # names that belong to no law
    in_set: bool  # each law is among the first statements or their alternatives
    set_size: float  # names of a statement with its alternatives, mean of the first ones


def statements(explanation: Explanation) -> tuple[Statement, ...]:
    """What an explanation reports as missing, in its order; each name once."""
    found = [Statement(e.id, e.joint, e.stage, e.alternatives) for e in explanation.effects]
    # The unknown term is the headline under the verdict UNKNOWN_PHYSICS, otherwise it comes last.
    # The function by which a named effect is modelled adds nothing to the name.
    term = explanation.unknown
    if term is not None and not any(
        e.joint == term.joint and e.id in term.siblings for e in explanation.effects
    ):
        unknown = Statement(term.place, term.joint, str(term.there.stage), term.rivals)
        place = 0 if explanation.verdict is Verdict.UNKNOWN_PHYSICS else len(found)
        found.insert(place, unknown)
    return tuple({(each.name, each.joint): each for each in found}.values())


def judged(
    laws: Sequence[Law], reported: Sequence[Statement], also: frozenset[str] = frozenset()
) -> Correctness:
    """Compare injected laws with statements, the most certain first; `also` is not judged."""
    named = [s for s in reported if any(_names(s, law) for law in laws)]
    wrong = [s for s in reported if s not in named and s.name not in also and not s.places & also]
    false = len({s.name for s in wrong})
    if not laws:
        none = not false
        return Correctness(none, none, none, none, false, none, 1.0)
    kept = _once([s for s in reported if s in named or s in wrong], laws)
    leading = kept[: len(laws)]
    first = _all(leading, laws, _names)
    return Correctness(
        first,
        _all(leading, laws, _is_at),
        _all(leading, laws, lambda s, law: s.stage == law.stage),
        first and len(kept) == len(laws),
        false,
        _all(leading, laws, _may_name),
        sum(1 + len(s.alternatives) for s in leading) / max(len(leading), 1),
    )


def is_of(name: str, joint: str, law: Law) -> bool:
    """Whether an effect or place on a joint is a right name of a law."""
    return _names(Statement(name, joint, ''), law)


def _names(statement: Statement, law: Law) -> bool:
    if law.joint not in ('', statement.joint):
        return False
    if law.is_unknown:
        return statement.name in FUNCTIONS
    return statement.name in law.ids or statement.name in law.places


def _is_at(statement: Statement, law: Law) -> bool:
    if law.joint not in ('', statement.joint):
        return False
    return statement.name in law.ids or bool(statement.places & law.places)


def _may_name(statement: Statement, law: Law) -> bool:
    names = (statement.name, *statement.alternatives)
    return any(_names(Statement(name, statement.joint, statement.stage), law) for name in names)


def _once(reported: Sequence[Statement], laws: Sequence[Law]) -> list[Statement]:
    """The statements, with a device's fault once although it shows on every joint."""
    of_device = {name for law in laws if not law.joint for name in law.ids}
    kept: dict[tuple[str, str], Statement] = {}
    for each in reported:
        kept.setdefault((each.name, '' if each.name in of_device else each.joint), each)
    return list(kept.values())


def _all(
    leading: Sequence[Statement], laws: Sequence[Law], agrees: Callable[[Statement, Law], bool]
) -> bool:
    """Whether each statement agrees with a law of its own."""
    return len(leading) == len(laws) and any(
        all(agrees(s, law) for s, law in zip(order, laws, strict=True))
        for order in permutations(leading)
    )
