"""Ablation: each component of the plant removed from the fit of a real tube, and the new answer."""

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
"""The alternative explanation of late cells."""


@dataclass(frozen=True)
class TakenOut:
    """One component removed from the plant of one tube."""

    piece: str
    tube: str
    costs: float  # loss of evidence without it, nats
    named: tuple[str, ...]  # in the order of the search
    number: tuple[float, float]  # its first parameter as found, NaN if not, and in the whole plant


@dataclass(frozen=True)
class Late:
    """Latency of one cell of a tube, as a delay and as a lag."""

    tube: str
    cell: str  # suffix of its wire
    delay_s: float
    lag_s: float
    for_delay: float  # evidence for a delay against a lag, nats


def whole_plant(observation: JointObservation) -> Fit:
    """Fit of the whole loops of a tube by the plant with friction in its bending section."""
    model = with_effect(wide(observation), KNOWN[SECTION], {})
    return Plant(model, as_described(model)).refitted()


def taken_out(folder: Path, jobs: int, report: Callable[[str], None]) -> list[TakenOut]:
    """Remove each component from each tube's plant, and explain the tube with the rest."""
    report('fitting whole loops of each tube')
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
        names = ', '.join(term.name for term in decision.missing) or 'nothing'
        report(f'{tube} without {piece}: {names}')
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
    folder: Path, jobs: int, report: Callable[[str], None], tubes: Sequence[str] = TUBES
) -> list[Late]:
    """Fit each tube to its angle and one of its cells alone, with a delay or a lag of the cell."""

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
        report(f'{tube}, cell of {cell}')
        return Late(
            tube,
            cell,
            _number(delayed, AGE),
            _number(lagged, OTHER_WAY),
            log_evidence(delayed) - log_evidence(lagged),
        )

    return parallel_map(one, [(tube, cell) for tube in tubes for cell in ('_pos', '_neg')], jobs)
