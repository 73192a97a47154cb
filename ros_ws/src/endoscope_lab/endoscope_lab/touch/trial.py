"""`endoscope bench touch`: error and bounds of the force at the tip, contacts and false alarms."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from endoscope_core.tip_force.estimator import AHEAD_S, REPORTED_WITHIN_S
from endoscope_core.tip_force.free_motion import BLOCK_S
from endoscope_lab.bench import keep_row, report, rows_so_far, side_by_side, table_head, table_row
from endoscope_lab.touch import derivation, push, visible
from endoscope_lab.touch.touched_rig import SIMULATORS, Touched, touched

TWICE = 2.0
"""Times the visible force, from which a contact has to be reported."""
_FREE_S = 600.0
_PARTED_S = 0.5
"""After a contact, before which an alarm is no false one."""


@dataclass(frozen=True)
class Row:
    """One rig; forces in N."""

    simulator: str
    seed: int
    obstacle: bool
    seconds: float  # of motion with a known force
    free_s: float  # of that, in free space
    largest: float  # true force
    visible: float  # median of the smallest force that would have been seen
    # Errors while it touches, over the largest force: beyond what friction leaves open, and all.
    beyond_median: float
    beyond_90: float
    error_median: float
    error_90: float
    held: float  # share of the samples in which the bounds hold the true force
    held_in_touch: float
    contacts: int  # of at least twice the visible force, for as long as they may take to report
    reported: int
    false_alarms: int

    @property
    def case(self) -> tuple[str, int, bool]:
        """As it was asked for."""
        return self.simulator, self.seed, self.obstacle


def run(args: argparse.Namespace) -> int:
    """Print the tables; return 0."""
    if args.derive:
        derivation.run(args.seeds, args.jobs)
        return 0
    if args.visible:
        visible.run(args.seeds[0], args.jobs)
        return 0
    if args.push is not None:
        pushes = [(simulator, seed) for seed in args.push for simulator in SIMULATORS]
        push.print_pushes(_rows(args, pushes, push.judged, push.Push))
        return 0
    cases = [(s, seed, True) for seed in args.seeds for s in SIMULATORS]
    cases += [(s, seed, False) for seed in args.free for s in SIMULATORS]
    _print(_rows(args, cases, judged, Row))
    return 0


def _rows[C: tuple[Any, ...], R: (Row, push.Push)](
    args: argparse.Namespace, cases: Sequence[C], judge: Callable[..., R], kind: type[R]
) -> list[R]:
    """Rows of all cases, of which those in the file are not judged again."""
    rows: dict[tuple[Any, ...], R] = {row.case: row for row in rows_so_far(args.json, kind)}
    calls = [case for case in cases if case not in rows]
    for number, (case, future) in enumerate(side_by_side(args.jobs, judge, calls), 1):
        rows[case] = future.result()
        keep_row(args.json, rows[case])
        report(f'{number} of {len(calls)}: {case[0]}, seed {case[1]}')
    return [rows[case] for case in cases]


def judged(simulator: str, seed: int, obstacle: bool) -> Row:
    """Judge one rig on one core."""
    with threadpool_limits(1):
        found = touched(simulator, seed, obstacle, 30.0 if obstacle else _FREE_S)
        return _row(found, simulator, seed, obstacle)


def _row(found: Touched, simulator: str, seed: int, obstacle: bool) -> Row:
    count = found.true.shape[1]
    force, low, high, widened = (
        np.array([getattr(f, name) for f in found.forces])[:, :count]
        for name in ('force', 'low', 'high', 'widened')
    )
    seen = np.array([f.seen for f in found.forces])
    visible = np.array([f.visible for f in found.forces])
    size = np.abs(found.true).max(axis=1)
    touching, largest = size > 0.0, float(size.max())
    beyond = np.maximum(0.0, np.maximum(low + widened - found.true, found.true - high + widened))
    held = ((low <= found.true) & (found.true <= high)).all(axis=1)
    contacts = _contacts(size > TWICE * visible)
    wait = round((REPORTED_WITHIN_S - AHEAD_S) / BLOCK_S)
    parted = round(_PARTED_S / BLOCK_S)
    near = np.convolve(touching, np.ones(parted + 1))[: len(touching)] > 0.0
    alarms = np.diff((seen & ~near).astype(int), prepend=0) > 0

    def of_touch(errors: NDArray[np.float64], share: float) -> float:
        sizes = errors.max(axis=1)[touching]
        return float(np.quantile(sizes, share)) / largest if len(sizes) else 0.0

    error = np.abs(force - found.true)
    return Row(
        simulator,
        seed,
        obstacle,
        len(seen) * BLOCK_S,
        float((~near).sum() * BLOCK_S),
        largest,
        float(np.median(visible)),
        of_touch(beyond, 0.5),
        of_touch(beyond, 0.9),
        of_touch(error, 0.5),
        of_touch(error, 0.9),
        float(held.mean()),
        float(held[touching].mean()) if touching.any() else 1.0,
        len(contacts),
        sum(bool(seen[begin : begin + wait + 1].any()) for begin in contacts),
        int(alarms.sum()),
    )


def _contacts(touching: NDArray[np.bool_]) -> list[int]:
    """Where contacts begin that last as long as they may take to report."""
    edges = np.diff(np.concatenate([[0], touching.astype(int), [0]]))
    begins, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    long = REPORTED_WITHIN_S / BLOCK_S
    return [int(b) for b, e in zip(begins, ends, strict=True) if e - b >= long]


def _print(rows: Sequence[Row]) -> None:
    columns = ('rigs', 'largest force', 'visible', 'error beyond friction', 'error', 'bounds hold')
    print(table_head('simulator', *columns, 'in touch', 'contacts reported', 'false alarms'))
    for simulator in (*SIMULATORS, 'both'):
        mine = [r for r in rows if simulator in (r.simulator, 'both')]
        touching = [r for r in mine if r.obstacle and r.largest > 0.0]
        if not touching:
            continue

        def of(name: str, share: float, rows: Sequence[Row] = touching) -> float:
            return float(np.quantile([getattr(row, name) for row in rows], share))

        reported, contacts = (sum(getattr(r, n) for r in mine) for n in ('reported', 'contacts'))
        print(
            table_row(
                simulator,
                len(touching),
                f'{of("largest", 0.5):.2f} N',
                f'{of("visible", 0.5):.2f} N',
                f'{of("beyond_median", 0.5):.1%}, {of("beyond_90", 0.9):.1%}',
                f'{of("error_median", 0.5):.1%}, {of("error_90", 0.9):.1%}',
                f'{np.mean([r.held for r in mine]):.1%}',
                f'{np.mean([r.held_in_touch for r in touching]):.1%}',
                f'{reported} of {contacts}',
                f'{sum(r.false_alarms for r in mine)} in {_hours(mine):.1f} h',
            )
        )
    print('Errors: median of the rigs, and 90 % of samples in 90 % of the rigs.')


def _hours(rows: Sequence[Row]) -> float:
    return sum(row.free_s for row in rows) / 3600.0
