"""`endoscope bench mistakes`: whether the audit reports mistakes of people, and nothing else."""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from endoscope_core.workers import worker_pool
from endoscope_explain.audit import AuditReport, audit_recording
from endoscope_explain.recording import BENDING, COMMAND, MOTOR, WIRES, RigRecording
from endoscope_lab.bench import table_head, table_row
from endoscope_lab.mistakes.drawing import (
    Generator,
    described,
    draw_recording,
    names_of,
    sound_recording,
)


def run(args: argparse.Namespace) -> int:
    """Print the cases that were not reported correctly and a table; return 0."""
    cases = [(name, seed) for name in MISTAKES for seed in args.seeds]
    cases += [('', seed) for seed in args.sound]
    rows = []
    with worker_pool(args.jobs) as pool:
        for row in pool.map(audited, *zip(*cases, strict=True)):
            rows.append(row)
            if not row.right:
                print(
                    f'{row.name or "no mistake"}, seed {row.seed}: {"; ".join(row.findings) or "-"}'
                )
    wrong = [row for row in rows if row.name]
    sound = [row for row in rows if not row.name]
    right = sum(row.right for row in wrong)
    missed = sum(not row.mistaken for row in wrong)
    slowest = max(row.seconds for row in rows)
    cells = {
        'mistakes': len(wrong),
        'reported correctly': f'{right} ({right / max(len(wrong), 1):.1%})',
        'missed': missed,
        'reported wrongly': len(wrong) - right - missed,
        'correct recordings': len(sound),
        'false alarms': sum(not row.right for row in sound),
        'slowest': f'{slowest:.1f} s',
    }
    print(table_head(*cells))
    print(table_row(*cells.values()))
    return 0


Change = Callable[[RigRecording, Generator], RigRecording]
Columns = Callable[[Generator, int], list[int]]
Expected = tuple[tuple[str, str, str], ...]
"""Id, topic and words of each finding."""


@dataclass(frozen=True)
class Mistake:
    """A change of a recording, and the findings that report it."""

    change: Change  # from a correct recording and a random generator to the mistaken recording
    expected: tuple[Expected, ...]  # alternatives, of which one must be found
    joints: int = 1  # number of joints that the recording must have


def scaled(
    quantity: str, factor: float | Callable[[Generator], float], columns: Columns | None = None
) -> Change:
    """Scale a quantity, or some of its columns, to another unit."""

    def change(recording: RigRecording, rng: Generator) -> RigRecording:
        series = getattr(recording, quantity)
        values = series.values.reshape(len(series.values), -1).copy()
        chosen = columns(rng, values.shape[1]) if columns else list(range(values.shape[1]))
        values[:, chosen] *= factor(rng) if callable(factor) else factor
        changed = replace(series, values=values.reshape(series.values.shape))
        return recording.with_series({quantity: changed})

    return change


def ordered(order: tuple[int, ...], *quantities: str) -> Change:
    def change(recording: RigRecording, _: Generator) -> RigRecording:
        changed = {}
        for quantity in quantities:
            series = getattr(recording, quantity)
            flat = series.values.reshape(len(series.values), -1)
            whole = [*order, *range(len(order), flat.shape[1])]
            changed[quantity] = replace(series, values=flat[:, whole].reshape(series.values.shape))
        return recording.with_series(changed)

    return change


def stamped(factor: float, *topics: str) -> Change:
    """Scale the stamps of some topics, or of all, to another unit."""

    def change(recording: RigRecording, _: Generator) -> RigRecording:
        every = {'command': recording.command, **recording.measured()}
        return recording.with_series(
            {
                name: replace(s, time=s.time * factor)
                for name, s in every.items()
                if not topics or s.topic in topics
            }
        )

    return change


def frozen(*quantities: str) -> Change:
    """Repeat the first reading of some quantities."""

    def change(recording: RigRecording, _: Generator) -> RigRecording:
        every = {'command': recording.command, **recording.measured()}
        return recording.with_series(
            {
                q: replace(
                    every[q], values=np.broadcast_to(every[q].values[:1], every[q].values.shape)
                )
                for q in quantities
            }
        )

    return change


def together(*changes: Change) -> Change:
    def change(recording: RigRecording, rng: Generator) -> RigRecording:
        for one in changes:
            recording = one(recording, rng)
        return recording

    return change


def one_column(rng: Generator, columns: int) -> list[int]:
    return [int(rng.integers(columns))]


DEG = 180.0 / np.pi
GRAVITY = 9.80665
MOTOR_QUANTITIES = ('shaft_position', 'shaft_velocity', 'shaft_effort')


def unit(topic: str, words: str) -> Expected:
    """The finding of a wrong unit."""
    return (('wrong_unit', topic, words),)


def of_gear(words: str) -> tuple[Expected, ...]:
    """Findings of a wrong gear, of the command or of the shaft: the recording is the same."""
    return (unit(COMMAND, words), (('wrong_gear', MOTOR, 'times as far as commanded'),))


MISTAKES = {
    'angle in deg': Mistake(scaled('bending', DEG), (unit(BENDING, 'in deg'),)),
    'angle in mrad': Mistake(scaled('bending', 1e3), (unit(BENDING, 'in mrad'),)),
    'shaft in deg': Mistake(scaled('shaft_position', DEG), (unit(MOTOR, 'in deg'),)),
    'shaft in counts': Mistake(
        scaled('shaft_position', 4096 / (2.0 * np.pi)), (unit(MOTOR, 'in counts'),)
    ),
    'command in deg': Mistake(scaled('command', DEG), (unit(COMMAND, 'in deg'),)),
    'command in mm of wire': Mistake(scaled('command', 2.4), of_gear('in mm of wire')),
    'command in joint rad': Mistake(scaled('command', 2.0), of_gear('of the bending joint')),
    'shaft in joint rad': Mistake(scaled('shaft_position', 2.0), of_gear('gear once more')),
    'another gear': Mistake(
        scaled('shaft_position', lambda rng: float(rng.choice([0.6, 0.8, 1.25, 1.5]))),
        ((('wrong_gear', MOTOR, 'times as far as commanded'),),),
    ),
    'all angles in deg': Mistake(
        together(*(scaled(q, DEG) for q in ('command', 'shaft_position', 'bending'))),
        (unit(COMMAND, 'in deg') + unit(MOTOR, 'in deg') + unit(BENDING, 'in deg'),),
    ),
    'speed in rpm': Mistake(scaled('shaft_velocity', 30.0 / np.pi), (unit(MOTOR, 'in rpm'),)),
    'effort in mN m': Mistake(scaled('shaft_effort', 1e3), (unit(MOTOR, 'in mN m'),)),
    'tension in mN': Mistake(scaled('tension', 1e3), (unit(WIRES, 'in mN'),)),
    'tension in g': Mistake(scaled('tension', 1e3 / GRAVITY), (unit(WIRES, 'in g'),)),
    'tension in kg': Mistake(scaled('tension', 1.0 / GRAVITY), (unit(WIRES, 'in kg'),)),
    'tension in counts': Mistake(
        scaled('tension', lambda rng: float(rng.choice([5e3, 2e4, 4e5]))),
        (unit(WIRES, 'counts of a converter'),),
    ),
    'tensions negative': Mistake(scaled('tension', -1.0), ((('wrong_sign', WIRES, 'negated'),),)),
    'one tension negative': Mistake(
        scaled('tension', -1.0, one_column), ((('wrong_sign', WIRES, 'negated'),),)
    ),
    'angle negative': Mistake(
        scaled('bending', -1.0, one_column), ((('wrong_sign', BENDING, 'negated'),),)
    ),
    'shaft negative': Mistake(
        scaled('shaft_position', -1.0, one_column), ((('wrong_sign', MOTOR, 'negated'),),)
    ),
    'command negative': Mistake(
        scaled('command', -1.0, one_column), ((('wrong_sign', COMMAND, 'negated'),),)
    ),
    'wires of a joint': Mistake(
        ordered((1, 0), 'tension'), ((('exchanged', WIRES, 'exchanged'),),)
    ),
    'wires of two joints': Mistake(
        ordered((2, 3, 0, 1), 'tension'), ((('exchanged', WIRES, 'exchanged'),),), 2
    ),
    'one wire of each joint': Mistake(
        ordered((2, 1, 0, 3), 'tension'), ((('exchanged', WIRES, 'exchanged'),),), 2
    ),
    'motors': Mistake(
        ordered((1, 0), *MOTOR_QUANTITIES), ((('exchanged', MOTOR, 'exchanged'),),), 2
    ),
    'commands': Mistake(ordered((1, 0), 'command'), ((('exchanged', COMMAND, 'exchanged'),),), 2),
    'tracker': Mistake(ordered((1, 0), 'bending'), ((('exchanged', BENDING, 'exchanged'),),), 2),
    'all stamps in ms': Mistake(stamped(1e3), (unit(COMMAND, 'in ms, not in s'),)),
    'all stamps in us': Mistake(stamped(1e6), (unit(COMMAND, 'in us, not in s'),)),
    'stamps taken for ms': Mistake(stamped(1e-3), (unit(COMMAND, 'were taken for ms'),)),
    "tracker's stamps in ms": Mistake(stamped(1e3, BENDING), (unit(BENDING, 'in ms, not in s'),)),
    "cells' stamps in us": Mistake(stamped(1e6, WIRES), (unit(WIRES, 'in us, not in s'),)),
    'frozen motor': Mistake(frozen(*MOTOR_QUANTITIES), ((('frozen', MOTOR, 'is frozen'),),)),
    'frozen cells': Mistake(frozen('tension'), ((('frozen', WIRES, 'is frozen'),),)),
    'frozen tracker': Mistake(frozen('bending'), ((('frozen', BENDING, 'is frozen'),),)),
    'frozen command': Mistake(frozen('command'), ((('frozen', COMMAND, 'is frozen'),),)),
}


def is_reported(mistake: Mistake, report: AuditReport) -> bool:
    """Whether a report has all findings of a mistake, and no others but notes."""
    found = [(f.id, f.signals[0].partition(':')[0], f.text) for f in report.faults()]
    for wanted in mistake.expected:
        left = list(found)
        for identity, topic, words in wanted:
            match = [f for f in left if f[:2] == (identity, topic) and words in f[2]]
            left = [f for f in left if f not in match[:1]]
            if not match:
                break
        else:
            if not left:
                return len(found) == len(report.mistakes())
    return False


@dataclass(frozen=True)
class AuditedMistake:
    """The audit of one recording."""

    name: str  # of the mistake; empty for a correct recording
    seed: int
    # The mistake and nothing else was reported, or nothing for a correct recording.
    right: bool
    mistaken: bool  # whether any mistake was reported
    seconds: float
    findings: tuple[str, ...]


def audited(name: str, seed: int) -> AuditedMistake:
    """Audit the recording of a seed with a mistake, or without one if the name is empty."""
    mistake = MISTAKES.get(name)
    if mistake is None:
        recording = sound_recording(seed)
    else:
        rng = np.random.default_rng([seed, list(MISTAKES).index(name)])
        joints = names_of(rng, mistake.joints)
        drawn, _ = draw_recording(rng, joints, 0.15, 0.5, int(rng.integers(0, 2)))
        recording = mistake.change(drawn, rng)
    begun = time.perf_counter()
    report = audit_recording(recording, described(recording))
    seconds = time.perf_counter() - begun
    mistaken = bool(report.mistakes())
    right = is_reported(mistake, report) if mistake else not mistaken
    findings = tuple(f.text for f in report.faults())
    return AuditedMistake(name, seed, right, mistaken, seconds, findings)
