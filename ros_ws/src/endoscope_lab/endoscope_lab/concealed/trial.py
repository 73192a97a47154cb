"""`endoscope bench concealed`: blind benchmark of explanations on rigs with injected effects."""

import argparse
import math
import time
from collections.abc import Iterator
from dataclasses import replace

from threadpoolctl import threadpool_limits

from endoscope_core.physics import PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.criteria import INTERVAL_WIDTH
from endoscope_explain.explain_recording import explain_recording
from endoscope_explain.explanation import Estimate, Explanation
from endoscope_lab.bench import keep_row, require_known, side_by_side
from endoscope_lab.concealed import confusion, derivation
from endoscope_lab.concealed.judge import (
    Case,
    Correctness,
    Law,
    judged,
    statements,
)
from endoscope_lab.concealed.readings import misfit
from endoscope_lab.concealed.row import Row, differences, rows_of, table
from endoscope_lab.concealed.sets import (
    all_are_reported,
    all_hold,
    judged_contests,
    mean_size,
)
from endoscope_lab.concealed.strata import STRATA, drawn_case
from endoscope_lab.concealed.strength import left


def run(args: argparse.Namespace) -> int:
    """Print a line for each case, then the table; return 1 if a case failed or differs."""
    strata = args.stratum or list(STRATA)
    require_known('stratum', strata, STRATA)
    before = rows_of(args.against) if args.against else {}
    cases = list(before) or [(name, seed) for seed in args.seeds for name in strata]
    kept = rows_of(args.json) if args.json and args.json.exists() else {}
    rows = {case: kept[case] for case in cases if case in kept}
    for case, future in side_by_side(args.jobs, explained, [c for c in cases if c not in rows]):
        error = future.exception()
        rows[case] = failed(*case, error) if error else future.result()
        print(rows[case].line(), flush=True)
        keep_row(args.json, rows[case])
    known = list(STRATA)
    print('\n' + table([rows[case] for case in sorted(cases, key=lambda c: known.index(c[0]))]))
    differ = [(c, each) for c in before for each in differences(before[c], rows[c])]
    for (stratum, seed), each in differ:
        print(f'{stratum} {seed}: {each}')
    if args.page:
        args.page.write_text(confusion.page(list(rows.values())), encoding='utf-8')
    if args.derive:
        derivation.derive(list(rows.values()), args.write)
    if before:
        print(f'{len(differ)} differences from {args.against} in {len(before)} cases')
    return 1 if differ or any(row.verdict == 'FAILED' for row in rows.values()) else 0


def explained(stratum: str, seed: int) -> Row:
    """Draw a case, explain it on one core, and judge the explanation."""
    return row_of(drawn_case(stratum, seed))


def explanation_of(case: Case) -> tuple[Explanation, float]:
    """Explain a case on one core, and measure how many seconds that takes."""
    with threadpool_limits(1):
        begun = time.monotonic()
        explanation = explain_recording(
            case.recording, case.described, baseline=case.baseline, left_out=case.left_out, jobs=1
        )
        return explanation, time.monotonic() - begun


def row_of(case: Case) -> Row:
    """Explain a case on one core, and judge the explanation."""
    return judged_row(case, *explanation_of(case))


def judged_row(case: Case, explanation: Explanation, seconds: float) -> Row:
    """Judge the explanation of a case, which took some seconds."""
    names = statements(explanation)
    errors = [_error(*number) for number in _numbers(case, explanation)]
    identifiable = identifiable_laws(case)
    contests = judged_contests(case, explanation, identifiable)
    judgement = judged(case.laws, names, case.also)
    if not judgement.false and all_are_reported(contests, case.laws):
        judgement = replace(judgement, first=True, place=True, stage=True, exact=True)
    in_set, set_size = all_hold(contests), mean_size(contests)
    judgement = replace(judgement, in_set=in_set, set_size=set_size)
    others = frozenset().union(*(law.ids for law in case.laws if law not in identifiable))
    first = judgement.first or judged(identifiable, names, case.also | others).first
    nominal, refitted, augmented = (
        misfit(plant, case.second, case.described.sensors)
        for plant in (explanation.nominal, explanation.refitted, explanation.augmented)
    )
    return Row(
        stratum=case.stratum,
        seed=case.seed,
        concealed=tuple(map(_named, case.laws)),
        note=case.note,
        moved=case.moved,
        left=_left(case),
        verdict=str(explanation.verdict),
        reported=tuple(f'{each.name}@{each.joint}' for each in names),
        held=sum(error <= 1.0 for error in errors),
        intervals=len(errors),
        nominal=nominal,
        refitted=refitted,
        augmented=augmented,
        seconds=seconds,
        beyond_form=explanation.beyond_form,
        errors=tuple(INTERVAL_WIDTH * error for error in errors),
        contests=tuple(each.kept() for each in contests),
        identifiable=tuple(map(_named, identifiable)),
        first_of_identifiable=first,
        **vars(judgement),
    )


def identifiable_laws(case: Case) -> tuple[Law, ...]:
    """Laws of which a refit of the rig's numbers leaves more than noise, each injected alone."""
    # Under most motions slack is confounded with a smaller pretension, and gravity with stiffness
    # and rest angle of the joint.
    if case.true == case.bare:
        return case.laws
    command = case.recording.command.values

    def alone(law: Law) -> PlantDescription:
        added = (e for e in case.true.effects if e not in case.bare.effects)
        own = [e for e in added if e.id in law.ids and law.joint in ('', e.joint)]
        return replace(case.bare, effects=(*case.bare.effects, *own))

    plants = map(alone, case.laws) if len(case.laws) > 1 else [case.true] * len(case.laws)
    return tuple(
        law
        for law, plant in zip(case.laws, plants, strict=True)
        if left(case.bare, plant, command) >= 1.0
    )


def _named(law: Law) -> str:
    return f'{law.name}@{law.joint or "all"}'


def _left(case: Case) -> float:
    """What a refit leaves of the laws, over noise; NaN for laws of another simulator."""
    if case.laws and case.true == case.bare:
        return math.nan
    return left(case.bare, case.true, case.recording.command.values) if case.laws else 0.0


def _error(true: float, found: Estimate) -> float:
    """Error over the half-width of the interval on that side."""
    allowed = found.high - found.value if true > found.value else found.value - found.low
    off = abs(true - found.value)
    return off / allowed if allowed > 0.0 else (0.0 if off == 0.0 else math.inf)


def _numbers(case: Case, explanation: Explanation) -> Iterator[tuple[float, Estimate]]:
    """True value of each estimated number, and its estimate."""
    for joint, estimates in explanation.parameters.items():
        true = case.true.joints[joint]
        for name, estimate in estimates.items():
            term = name.removeprefix('friction_profile_')
            terms = (*true.friction_profile, 0.0, 0.0, 0.0, 0.0)
            value = getattr(true, name) if term == name else terms[int(term) - 1]
            yield value, estimate
    for effect in explanation.effects:
        for spec in case.true.effects:
            if (spec.id, spec.joint) == (effect.id, effect.joint):
                for each in CATALOGUE[spec.id].parameters:
                    if each.comparable and each.name in effect.parameters:
                        yield spec.parameters[each.name], effect.parameters[each.name]


def failed(stratum: str, seed: int, error: BaseException) -> Row:
    """The row of a case that could not be explained: wrong in every respect."""
    wrong = Correctness(False, False, False, False, 0, False, math.nan)
    return Row(
        stratum=stratum,
        seed=seed,
        concealed=(),
        note=f'{type(error).__name__}: {error}',
        moved=math.nan,
        left=math.nan,
        verdict='FAILED',
        reported=(),
        **vars(wrong),
    )
