"""One recording with a mistake, or without, and what the audit says of it."""

import time
from dataclasses import dataclass

import numpy as np

from endoscope_benchmarks.mistakes.deriving import sound_recording
from endoscope_benchmarks.mistakes.drawing import described, draw_recording, names_of
from endoscope_benchmarks.mistakes.mistake import MISTAKES, is_said
from endoscope_explain.audit import audit_recording


@dataclass(frozen=True)
class Row:
    """What was said."""

    name: str  # of the mistake; empty where none was made
    seed: int
    # The mistake and nothing else was said, or nothing where none was made.
    right: bool
    mistaken: bool  # whether any mistake was said
    seconds: float
    said: tuple[str, ...]


def audited(name: str, seed: int) -> Row:
    """Audit the recording of a seed with a mistake; without, where it has no name."""
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
    right = is_said(mistake, report) if mistake else not mistaken
    said = tuple(f.text for f in report.faults())
    return Row(name, seed, right, mistaken, seconds, said)
