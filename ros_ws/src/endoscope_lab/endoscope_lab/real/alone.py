"""Explanation of each tube alone, and of all tubes where the right name is withheld."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_core.workers import parallel_map
from endoscope_explain.decide.decision import decide
from endoscope_explain.search.levels import Level, search
from endoscope_lab.real.explained import as_fit, fitted_as_one
from endoscope_lab.real.pieces import SECTION
from endoscope_lab.real.rig import Plant, as_described, wide
from endoscope_lab.real.takes import TUBES, read

Array = NDArray[np.float64]
Report = Callable[[str], None]


@dataclass(frozen=True)
class Alone:
    """Missing physics by the whole loops of one tube alone."""

    tube: str
    named: tuple[str, ...]  # in the order in which they were found
    gain: float  # nats of the first one
    p_value: float  # chance of such a gain in a rig without it
    # Candidates with more evidence that do not predict the branches that the tube passes again.
    dismissed: tuple[str, ...]


@dataclass(frozen=True)
class Withheld:
    """Missing physics of all tubes where friction of the bending section may not be named."""

    named: tuple[str, ...]
    levels: tuple[Level, ...]  # of the search
    # The first function, by tube: the state at its nodes and the values there (NODES,).
    curves: tuple[tuple[Array, Array], ...] = field(repr=False)


def each_alone(folder: Path, jobs: int, report: Report) -> list[Alone]:
    """Explain the whole loops of each tube alone."""

    def one(tube: str) -> Alone:
        model = wide(read(folder / f'{tube}.txt').observation())
        start = as_described(model)
        refitted = Plant(model, start).refitted()
        tried = search([(refitted, as_fit(model, start))], 1)
        first, named = tried.levels[0], tuple(t.name for t in decide(tried, 1).missing)
        report(f'{tube} alone: {", ".join(named) or "nothing"}')
        better = [c for c in first.not_foretelling if c.evidence > first.best.evidence]
        dismissed = tuple(c.terms[-1].id if c.terms else 'other numbers' for c in better)
        return Alone(tube, named, first.gain(first.best), first.p_value, dismissed)

    return parallel_map(one, TUBES, jobs)


def name_withheld(folder: Path, jobs: int, report: Report) -> Withheld:
    """Explain the whole loops of all tubes together, without the friction of the section."""
    fits, described = fitted_as_one([read(folder / f'{t}.txt').observation() for t in TUBES])
    references = list(zip(fits, described, strict=True))
    tried = search(references, jobs, 1, (SECTION,), report=report)
    curves = []
    for found in tried.levels[0].best.fits:
        for family, own in zip(
            found.model.families, found.model.coefficients(found.theta), strict=True
        ):
            curves.append((family.nodes, family.values(own)))
    return Withheld(tuple(t.id for t in tried.found.terms), tried.levels, tuple(curves))
