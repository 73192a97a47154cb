"""Each piece of the plant taken out of a real tube's fit, and what is then named in its place."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from endoscope_core.physics.effects import KNOWN
from endoscope_core.workers import parallel_map
from endoscope_explain.decide.decision import decide
from endoscope_explain.fit.evidence import log_evidence
from endoscope_explain.fit.model import Fit, without_effect
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.search.levels import search
from endoscope_explain.search.term import with_effect
from endoscope_lab.real.rig import AGE, Plant, as_described, wide
from endoscope_lab.real.takes import TUBES, read

SECTION = 'section_friction'
PIECES = (
    'wire_stretch',
    'wire_pretension',
    'sheath_friction',
    'bending_stiffness',
    'bending_friction',
    SECTION,
    AGE,
)
OTHER_WAY = 'load_cell_lag'
"""How else cells are late."""


@dataclass(frozen=True)
class TakenOut:
    """One piece taken out of one tube."""

    piece: str
    tube: str
    costs: float  # nats of evidence that the tube loses without it
    named: tuple[str, ...]  # in the order in which it was said
    number: tuple[float, float]  # its first parameter as found, nan if not, and in the whole plant


@dataclass(frozen=True)
class Late:
    """Which cell of a tube is late, and how."""

    tube: str
    cell: str  # of which wire
    delay_s: float
    lag_s: float
    for_delay: float  # nats by which a delay explains more than a lag


def whole_plant(observation: JointObservation) -> Fit:
    """Whole loops of a tube, fitted by the plant with friction in its bending section."""
    model = with_effect(wide(observation), KNOWN[SECTION], {})
    return Plant(model, as_described(model)).refitted()


def taken_out(folder: Path, jobs: int, tell: Callable[[str], None]) -> list[TakenOut]:
    """Take each piece out of each tube's plant, and explain the tube with what is left."""
    tell('fitting whole loops of each tube')
    seen = [read(folder / f'{tube}.txt').observation() for tube in TUBES]
    fits = parallel_map(whole_plant, seen, jobs)
    tasks = [
        (piece, tube, found) for piece in PIECES for tube, found in zip(TUBES, fits, strict=True)
    ]

    def one(task: tuple[str, str, Fit]) -> TakenOut:
        piece, tube, whole = task
        lesser = Plant(*without_effect(whole, piece)).refitted()
        decision = decide(search([(lesser,)], 1, 1), 1)
        found = decision.chosen
        number = _number(found.fit, piece) if piece in found.effects else float('nan')
        tell(f'{tube} without {piece}: {", ".join(t.name for t in decision.missing) or "nothing"}')
        return TakenOut(
            piece,
            tube,
            log_evidence(whole) - log_evidence(lesser),
            tuple(term.name for term in decision.missing),
            (number, _number(whole, piece)),
        )

    return parallel_map(one, tasks, jobs)


def _number(found: Fit, piece: str) -> float:
    packed, _ = found.model.packed(found.theta)
    return float(packed[KNOWN[piece].first_parameter])


def late_cells(
    folder: Path, jobs: int, tell: Callable[[str], None], tubes: Sequence[str] = TUBES
) -> list[Late]:
    """Fit each tube to its angle and one of its cells alone, which is late by a delay or a lag."""

    def one(task: tuple[str, str]) -> Late:
        tube, cell = task
        observation = read(folder / f'{tube}.txt').observation()
        kept = tuple(
            c for c in observation.channels if c.quantity != 'tension' or c.signal.endswith(cell)
        )
        delayed = whole_plant(replace(observation, channels=kept))
        without, begun = without_effect(delayed, AGE)
        lagging = with_effect(without, KNOWN[OTHER_WAY], {})
        lagged = Plant(lagging, lagging.begun_at(begun)).refitted()
        tell(f'{tube}, cell of {cell}')
        return Late(
            tube,
            cell,
            _number(delayed, AGE),
            _number(lagged, OTHER_WAY),
            log_evidence(delayed) - log_evidence(lagged),
        )

    return parallel_map(one, [(tube, cell) for tube in tubes for cell in ('_pos', '_neg')], jobs)
