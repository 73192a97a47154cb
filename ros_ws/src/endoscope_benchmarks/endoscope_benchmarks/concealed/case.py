"""What a case is: a rig, what is concealed in it, and its recordings."""

from dataclasses import dataclass

from endoscope_core.physics import PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
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
