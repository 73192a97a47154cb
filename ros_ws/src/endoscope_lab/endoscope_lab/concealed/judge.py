"""What is concealed in a case, what is said of it, and when that is right."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations

from endoscope_core.physics import PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_explain.explanation import Explanation, Verdict
from endoscope_explain.recording import Recording


@dataclass(frozen=True)
class Law:
    """A concealed law, and what may be said of it."""

    name: str  # effect, or place of the law
    joint: str  # on which it acts; empty where it acts on all
    stage: str  # of the chain
    ids: frozenset[str]  # effects that are a right name
    places: frozenset[str]  # places that are right
    is_unknown: bool = False  # the right name is that it is unknown, wherever it is said to be


@dataclass(frozen=True)
class Case:
    """A rig as it was described and as it is, and its recordings."""

    stratum: str
    seed: int
    # The rig as its engineer describes it, as it is without the laws, and with them.
    described: PlantDescription
    bare: PlantDescription
    true: PlantDescription
    laws: tuple[Law, ...]  # concealed; empty where nothing is
    recording: Recording  # to explain
    second: Recording  # of another motion, to judge on
    baseline: Recording | None = None  # the rig before anything was concealed
    left_out: tuple[str, ...] = ()  # effects whose formulas are not tried
    # Effects and places that are no false names: the form of the rig itself.
    also: frozenset[str] = frozenset()
    # What the laws change, over the signal, each alone, of the channel that shows it most: the
    # least of them.
    moved: float = 0.0
    note: str = ''  # what else is particular


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
    """One thing that is said to be missing."""

    name: str  # effect, or place of an unknown term
    joint: str
    stage: str
    rivals: tuple[str, ...] = ()  # names that may stand for it as well

    @property
    def places(self) -> frozenset[str]:
        """Places that it points at."""
        if self.name in FUNCTIONS:
            return frozenset({self.name})
        return frozenset(CATALOGUE[self.name].traits.families)


@dataclass(frozen=True)
class Judgement:
    """How far what is said is right."""

    # As many statements as there are laws, the first ones, name all of them; where nothing is
    # concealed, nothing is said.
    first: bool
    place: bool  # they point at the right places
    stage: bool  # and at the right parts of the chain
    exact: bool  # all is named first, and nothing else is said
    false: int  # names that are of no law
    in_set: bool  # each law is among the first statements or their rivals
    set_size: float  # names of a statement with its rivals, mean of the first ones


def statements(said: Explanation) -> tuple[Statement, ...]:
    """What an explanation says is missing, in its order; each name once."""
    found = [Statement(e.id, e.joint, e.stage, e.alternatives) for e in said.effects]
    # The unknown term is the headline where the verdict says so, else it comes last; the function
    # by which a named effect is modelled says no more than the name.
    term = said.unknown
    if term is not None and not any(
        e.joint == term.joint and e.id in term.siblings for e in said.effects
    ):
        unknown = Statement(term.place, term.joint, str(term.there.stage), term.rivals)
        place = 0 if said.verdict is Verdict.UNKNOWN_PHYSICS else len(found)
        found.insert(place, unknown)
    return tuple({(each.name, each.joint): each for each in found}.values())


def judged(
    laws: Sequence[Law], said: Sequence[Statement], also: frozenset[str] = frozenset()
) -> Judgement:
    """Compare what is concealed with what is said, the most certain first; `also` is not judged."""
    named = [s for s in said if any(_names(s, law) for law in laws)]
    wrong = [s for s in said if s not in named and s.name not in also and not s.places & also]
    false = len({s.name for s in wrong})
    if not laws:
        none = not false
        return Judgement(none, none, none, none, false, none, 1.0)
    kept = _once([s for s in said if s in named or s in wrong], laws)
    leading = kept[: len(laws)]
    first = _all(leading, laws, _names)
    return Judgement(
        first,
        _all(leading, laws, _is_at),
        _all(leading, laws, lambda s, law: s.stage == law.stage),
        first and len(kept) == len(laws),
        false,
        _all(leading, laws, _may_name),
        sum(1 + len(s.rivals) for s in leading) / max(len(leading), 1),
    )


def is_of(name: str, joint: str, law: Law) -> bool:
    """Whether an effect or place on a joint is what a law is called."""
    return _names(Statement(name, joint, ''), law)


def _names(said: Statement, law: Law) -> bool:
    if law.joint not in ('', said.joint):
        return False
    if law.is_unknown:
        return said.name in FUNCTIONS
    return said.name in law.ids or said.name in law.places


def _is_at(said: Statement, law: Law) -> bool:
    if law.joint not in ('', said.joint):
        return False
    return said.name in law.ids or bool(said.places & law.places)


def _may_name(said: Statement, law: Law) -> bool:
    names = (said.name, *said.rivals)
    return any(_names(Statement(name, said.joint, said.stage), law) for name in names)


def _once(said: Sequence[Statement], laws: Sequence[Law]) -> list[Statement]:
    """What is said, a device's fault once although it shows on every joint."""
    of_device = {name for law in laws if not law.joint for name in law.ids}
    kept: dict[tuple[str, str], Statement] = {}
    for each in said:
        kept.setdefault((each.name, '' if each.name in of_device else each.joint), each)
    return list(kept.values())


def _all(
    said: Sequence[Statement], laws: Sequence[Law], agrees: Callable[[Statement, Law], bool]
) -> bool:
    """Whether each statement agrees with a law of its own."""
    return len(said) == len(laws) and any(
        all(agrees(s, law) for s, law in zip(order, laws, strict=True))
        for order in permutations(said)
    )
