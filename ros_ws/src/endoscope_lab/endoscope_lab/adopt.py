"""`endoscope bench adopt`: how a rig tracks once the plant that was found is put into force."""

import argparse
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from endoscope_core.control import AdoptedPlant, AdoptionError, FeedforwardLaw, adopted_plant
from endoscope_core.control.adopted_plant import is_inverted
from endoscope_core.metrics import tracking_rmse
from endoscope_core.physics import PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.plant_file import plant_as_text
from endoscope_core.rig import shipped_rig
from endoscope_core.signals import Signal, non_periodic_signal
from endoscope_explain.audit import audit_recording
from endoscope_explain.case import ExplainedCase
from endoscope_explain.pipeline import Inputs, Sources, explain_case
from endoscope_lab.bench import (
    keep_row,
    report,
    rows_so_far,
    side_by_side,
    table_head,
    table_row,
    today_and_machine,
)
from endoscope_lab.concealed.forms import DRAWN
from endoscope_lab.concealed.judge import Case, judged, statements
from endoscope_lab.concealed.strata import AIM, as_strong
from endoscope_lab.papers.tracking_trial import run_tracking_trial, within_ranges
from endoscope_lab.proof.another_rig import FORMS, Laws, read
from endoscope_lab.proof.drawing import of_other_simulator

LARGE = (math.sqrt(AIM[0] * AIM[1]), AIM[1])
"""The upper half, by its logarithm, of the shares of a signal that a concealed effect moves."""
KNOWABLE = tuple(effect for effect in DRAWN if is_inverted(CATALOGUE[effect]))
"""Effects that an inverse can know."""
OTHERS = tuple(effect for effect in DRAWN if effect not in KNOWABLE)
"""Effects of sensors and of what depends on the time: no inverse has them."""
KNOWN, UNKNOWN, FOREIGN = 'known', 'unknown', 'foreign'
"""Kinds of rigs: with an effect that an inverse can know, with another one, and with one of the
first in the simulator that shares nothing with the kernel."""
_EFFECTS = {
    KNOWN: KNOWABLE,
    UNKNOWN: OTHERS,
    FOREIGN: tuple(effect for effect in FORMS if effect in KNOWABLE),
}
_WORDS = {
    KNOWN: 'effects that an inverse can know',
    UNKNOWN: 'effects that no inverse has',
    FOREIGN: 'effects of another simulator',
}
GOAL = 25.0
"""Median of what is left of the error with the described plant, in percent."""
_PLANTS = ('described', 'refitted', 'adopted', 'true')


@dataclass(frozen=True)
class Row:
    """A rig that lacks an effect in its description, and how it tracks by the inverse of a plant.

    Rms errors of the tip in rad, of all joints: by the plant as described, with its numbers
    refitted, as explained, and as it is; NaN where there is no plant or it cannot be inverted.
    """

    kind: str
    seed: int
    effect: str
    moved: float  # share of the signal
    found: tuple[str, ...]  # most certain first
    is_right: bool  # whether the first name is that of the effect
    described: float
    refitted: float
    adopted: float
    true: float
    refused: str  # why the plant as explained is not adopted: the described one stays in force
    seconds: float  # that explaining took

    @property
    def share(self) -> float:
        """Of the error with the described plant, what is left in percent."""
        return 100.0 * self.adopted / self.described

    def line(self) -> str:
        """As a row of a table."""
        errors = [f'{math.degrees(getattr(self, plant)):.2f}' for plant in _PLANTS]
        right = '' if self.is_right else ', wrong'
        refused = f', refused: {self.refused}' if self.refused else ''
        found = f'{" + ".join(self.found) or "nothing"}{right}{refused}'
        moved = f'{100.0 * self.moved:.0f} %'
        share = f'{self.share:.0f} %'
        return table_row(
            self.seed, self.effect, moved, found, *errors, share, f'{self.seconds:.0f}'
        )


def run(args: argparse.Namespace) -> int:
    """Print a line for each rig as it is known, then the medians; 1 if the goal is missed."""
    of_kind = {KNOWN: args.seeds, UNKNOWN: args.others, FOREIGN: args.foreign}
    calls = [(kind, seed) for kind, seeds in of_kind.items() for seed in seeds or ()]
    ends = time.monotonic() + args.within
    kept = rows_so_far(args.json, Row)
    rows = {(row.kind, row.seed): row for row in kept}
    errors = (f'{plant}, deg' for plant in _PLANTS)
    print(today_and_machine())
    print(table_head('seed', 'concealed', 'moves', 'found', *errors, 'left', 's'))
    for call, future in side_by_side(args.jobs, adopted, [c for c in calls if c not in rows]):
        rows[call] = future.result()
        print(rows[call].line(), flush=True)
        keep_row(args.json, rows[call])
        if time.monotonic() > ends:
            report(f'ended after {args.within:g} s with {len(rows)} of {len(calls)} rigs')
            break
    wanted = [rows[call] for call in calls if call in rows]
    print()
    for kind in of_kind:
        of = [row for row in wanted if row.kind == kind]
        if of:
            print(summary(kind, of))
    known = [row.share for row in wanted if row.kind == KNOWN]
    return 1 if known and float(np.median(known)) > GOAL else 0


def adopted(kind: str, seed: int) -> Row:
    """Draw a rig with a large effect, explain it on one core, adopt what was found, and track."""
    rig = drawn(kind, seed)
    with threadpool_limits(1):
        begun = time.monotonic()
        audit = audit_recording(rig.case.recording, rig.case.described)
        sources = Sources(Path(rig.case.recording.name), rig.case.described, quick=True)
        explained = explain_case(Inputs(sources, audit), jobs=1)
        seconds = time.monotonic() - begun
        return _row(kind, seed, rig, explained, seconds)


@dataclass(frozen=True)
class DrawnRig:
    """A rig to be explained."""

    case: Case
    effect: str
    error: Callable[[Signal, FeedforwardLaw], float]
    """Moves it along a signal by a law; rms error in rad."""


def drawn(kind: str, seed: int) -> DrawnRig:
    """A rig of a seed, with the effect whose turn it is or the next one that can be as large."""
    effects = _EFFECTS[kind]
    order = np.random.default_rng(len(effects)).permutation(len(effects))
    for k in range(len(effects)):
        effect = effects[int(order[(seed + k) % len(effects)])]
        try:
            if kind == FOREIGN:
                case, truth = of_other_simulator(np.random.default_rng(seed), effect, LARGE)
                return DrawnRig(case, effect, partial(_foreign_error, case, Laws(**truth['laws'])))
            case = as_strong(effect, seed, LARGE)
            return DrawnRig(case, effect, partial(_own_error, case))
        except RuntimeError:
            # It cannot move as much, since it has an end.
            continue
    raise RuntimeError(f'no effect of seed {seed} can be large')


def _own_error(case: Case, signal: Signal, law: FeedforwardLaw) -> float:
    return run_tracking_trial(case.true, signal, law, False, case.seed).rmse


def _foreign_error(case: Case, laws: Laws, signal: Signal, law: FeedforwardLaw) -> float:
    # Nothing is fed back: the command is the same on any rig.
    trial = run_tracking_trial(case.described, signal, law, False, case.seed)
    (joint,) = case.true.joints.values()
    rig = read(joint, laws, shipped_rig().joints.gear * trial.command)
    steady = (rig.tracker_time >= signal.steady[0]) & (rig.tracker_time <= signal.steady[1])
    desired, _ = signal(rig.tracker_time[steady])
    return tracking_rmse(desired, rig.bending[steady, 0])


def _row(kind: str, seed: int, rig: DrawnRig, explained: ExplainedCase, seconds: float) -> Row:
    case, explanation = rig.case, explained.explanation
    # No plant describes the rig of another simulator.
    true = (case.true,) if kind != FOREIGN else ()
    plants = (case.described, explanation.refitted, explained.plant, *true)
    laws, why = dict[str, AdoptedPlant](), dict[str, str]()
    for name, plant in zip(_PLANTS, plants, strict=False):
        try:
            laws[name] = as_adopted(plant)
        except AdoptionError as error:
            why[name] = f'{error.code}'
    ranges = [within for law in laws.values() for within in law.ranges]
    signal = within_ranges(non_periodic_signal(), ranges)
    errors = dict.fromkeys(_PLANTS, math.nan)
    errors |= {name: rig.error(signal, law.law) for name, law in laws.items()}
    if 'adopted' in why:
        errors['adopted'] = errors['described']
    names = statements(explanation)
    return Row(
        kind=kind,
        seed=seed,
        effect=rig.effect,
        moved=case.moved,
        found=tuple(each.name for each in names),
        is_right=judged(case.laws, names).first,
        **errors,
        refused=why.get('adopted', ''),
        seconds=seconds,
    )


def as_adopted(plant: PlantDescription) -> AdoptedPlant:
    """The plant as a compensator puts its file into force; AdoptionError if it refuses."""
    return adopted_plant(plant_as_text(plant), shipped_rig(), plant.joint_names())


def summary(kind: str, rows: Sequence[Row]) -> str:
    """Medians of what is left over rigs of a kind, in words."""
    words = {'adopted': 'adopted', 'refitted': 'refitted numbers alone', 'true': 'the true plant'}
    medians = []
    for plant, how in words.items():
        left = np.array([100.0 * getattr(row, plant) / row.described for row in rows])
        if np.isfinite(left).any():
            medians.append(f'{np.nanmedian(left):.0f} % {how}')
    return (
        f'{_WORDS[kind]}: {len(rows)} rigs, {sum(row.is_right for row in rows)} named first, '
        f'{sum(bool(row.refused) for row in rows)} refused; left of the error, median: '
        + ', '.join(medians)
    )
