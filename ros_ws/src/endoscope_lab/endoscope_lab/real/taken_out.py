"""Pieces of the nominal physics taken out of a real tube's plant, one at a time, and looked for."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from endoscope_core.physics.effect import NominalPhysics
from endoscope_core.physics.effects import NOMINAL_PHYSICS
from endoscope_explain.decide.decision import decide
from endoscope_explain.fit.evidence import log_evidence
from endoscope_explain.fit.intervals import effect_estimates, with_form
from endoscope_explain.fit.model import Fit, without_effect
from endoscope_explain.search.levels import search
from endoscope_lab.bench import table_head, table_row
from endoscope_lab.real.explained import Number, Tell
from endoscope_lab.real.rig import Plant, Told, as_described, wide
from endoscope_lab.real.takes import TUBES, read


@dataclass(frozen=True)
class TakenOut:
    """What was made of a tube whose plant lacks a piece."""

    tube: str
    piece: str
    lost: float  # logarithm of the evidence that the piece's lack costs
    named: tuple[str, ...]  # what is missing, in the order in which it was found
    # The piece's first number and its interval as found; None where it was not.
    number: Number | None
    whole: Number  # the same of the whole plant, fitted to the same cycle
    # Without the piece, with what was found, and whole; on the second cycle.
    told: Told

    @property
    def is_first(self) -> bool:
        """Whether the piece is named before anything else."""
        return self.named[:1] == (self.piece,)

    @property
    def is_better(self) -> bool:
        """Whether the second cycle is predicted better with what was named."""
        before, after = (np.array(self.told.left(name)) for name in ('refitted', 'augmented'))
        return bool(np.sum(np.log(after / before)) < 0.0)

    @property
    def agrees(self) -> bool:
        """Whether the number and that of the whole plant lie within each other's intervals."""
        if self.number is None:
            return False
        (value, low, high), (whole, least, most) = self.number, self.whole
        return low <= whole <= high or least <= value <= most


def taken_out(folder: Path, jobs: int, tell: Tell) -> list[TakenOut]:
    """Take each piece out of each tube's plant and search what its first cycle lacks."""
    rows = []
    for name in TUBES:
        take = read(folder / f'{name}.txt')
        cycle = take.until(take.cycle_s).observation()
        model = wide(cycle)
        whole = with_form(Plant(model, as_described(model)).refitted(), jobs)
        for piece in NOMINAL_PHYSICS.values():
            tell(f'tube {name} without {piece.id}')
            without = Plant(*without_effect(whole, piece.id)).refitted()
            decision = decide(search([(without,)], jobs, 0), jobs)
            found = decision.chosen.fit
            seen = take.observation()
            plants = {
                'refitted': Plant.of(without).on(seen),
                'augmented': Plant.of(found).on(seen),
                'whole': Plant.of(whole).on(seen),
            }
            rows.append(
                TakenOut(
                    name,
                    piece.id,
                    log_evidence(whole) - log_evidence(without),
                    tuple(term.name for term in decision.missing),
                    _number(found, piece) if piece.id in decision.chosen.effects else None,
                    _number(whole, piece),
                    Told(take, take.cycle_s, plants),
                )
            )
    return rows


def as_table(rows: list[TakenOut]) -> str:
    """The rows as a table, and what they come to."""
    columns = ('tube', 'taken out', 'nats lost', 'named', 'its number', 'of the whole plant')
    cycles = ('without it', 'with what was named', 'whole')
    head = (*columns, *(f'second cycle {each}' for each in cycles))
    lines = [table_head(*head)]
    for row in rows:
        number = '-' if row.number is None else _shown(row.number)
        left = [_left(row, name) for name in row.told.plants]
        cells = [row.tube, row.piece, f'{row.lost:.0f}', ', '.join(row.named) or 'nothing']
        lines.append(table_row(*cells, number, _shown(row.whole), *left))
    first = [row for row in rows if row.is_first]
    agree = sum(row.agrees for row in first)
    better = sum(row.is_better for row in first)
    lines.append(
        f'\nnamed first {len(first)} of {len(rows)}; of these the number agrees with the whole '
        f"plant's in {agree}, and the second cycle is predicted better in {better}"
    )
    return '\n'.join(lines)


def _shown(number: Number) -> str:
    value, low, high = number
    return f'{value:.3g} ({low:.3g} to {high:.3g})'


def _left(row: TakenOut, name: str) -> str:
    angle, *tensions = row.told.left(name)
    return ' / '.join([f'{np.degrees(angle):.2f}', *(f'{t:.2f}' for t in tensions)])


def _number(found: Fit, piece: NominalPhysics) -> Number:
    """The first number of a piece that a fit has, and its interval."""
    first = piece.parameters[0]
    estimate = effect_estimates(found, piece.first_parameter, {first.name: first.unit})[first.name]
    return estimate.value, estimate.low, estimate.high
