"""The order of a proof: record and seal all rigs, print the digests, explain, then open."""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path

from endoscope_core.workers import worker_pool
from endoscope_explain.report.numbers import digits
from endoscope_lab.proof import SLAVE, sentences
from endoscope_lab.proof.trial import (
    Outcome,
    SealedAnswer,
    SealedRig,
    compared,
    explained,
    folder_of,
    followed,
    recorded,
)

Report = Callable[[str], None]


@dataclass(frozen=True)
class Proof:
    """Settings of a proof."""

    count: int  # rigs
    form: str  # of `SIMULATORS`, or `SLAVE`
    seed: int
    effect: str | None  # injected effect; drawn if None
    jobs: int  # rigs in parallel
    command: str  # as it was typed


def prove(proof: Proof, folder: Path, report: Report) -> list[Outcome]:
    """Record rigs into a folder, explain them, and compare explanations with sealed truths."""
    with worker_pool(min(proof.jobs, proof.count)) as pool:
        rigs = _recorded(proof, folder, pool, report)
        answers = _explained(proof, rigs, pool, report)
        report('The seals are opened:')
        outcomes = [compared(rig, answers[rig.number]) for rig in rigs]
        for each in outcomes:
            report(
                f'rig {each.rig.number}: injected was {sentences.injected(each)}: '
                f'{sentences.result(each)}; second recording {digits(each.answer.before)} > '
                f'{digits(each.answer.after)} times its noise'
            )
        if proof.form == SLAVE:
            outcomes = _followed(proof, outcomes, pool, report)
    return outcomes


def _followed(
    proof: Proof, outcomes: list[Outcome], pool: ProcessPoolExecutor, report: Report
) -> list[Outcome]:
    report('The slaves track a motion with the inverse of either plant:')
    tasks = [pool.submit(followed, each.rig.folder, each.truth, proof.seed) for each in outcomes]
    moved = []
    for each, task in zip(outcomes, tasks, strict=True):
        moved.append(replace(each, tracking=task.result()))
        report(f'rig {each.rig.number}: {sentences.tracking(moved[-1])}')
    return moved


def _recorded(
    proof: Proof, folder: Path, pool: ProcessPoolExecutor, report: Report
) -> list[SealedRig]:
    tasks = [
        pool.submit(recorded, proof.form, proof.seed, k, proof.effect, folder / folder_of(k))
        for k in range(1, proof.count + 1)
    ]
    rigs = []
    for task in tasks:
        rigs.append(task.result())
        report(f'rig {rigs[-1].number}: recorded; sealed, SHA-256 {rigs[-1].sha256}')
    return rigs


def _explained(
    proof: Proof, rigs: list[SealedRig], pool: ProcessPoolExecutor, report: Report
) -> dict[int, SealedAnswer]:
    tasks = [pool.submit(explained, rig.number, rig.folder, proof.command) for rig in rigs]
    answers = {}
    for task in as_completed(tasks):
        answer = task.result()
        answers[answer.number] = answer
        report(f'rig {answer.number}: {answer.sentence} ({answer.seconds:.0f} s)')
    return answers
