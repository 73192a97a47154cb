"""The loop: a motion, what all recordings say together, and the motion that would tell more."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from endoscope_core.atomic_output import write_text
from endoscope_core.errors import EndoscopeError
from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.effects import KNOWN
from endoscope_core.physics.plant_file import load_plant, save_plant
from endoscope_core.rig import Rig
from endoscope_core.signals.command_file import JOINTS, write_command_file
from endoscope_explain.case import ExplainedCase, NextExperiment
from endoscope_explain.design import is_wide, narrow, propose
from endoscope_explain.explanation import NamedEffect
from endoscope_explain.investigation import log as logs
from endoscope_explain.investigation.log import Answer, Log, Name, Round, Stop
from endoscope_explain.investigation.motions import (
    Motion,
    commissioning,
    of_experiment,
    require_allowed,
)
from endoscope_explain.observe.predicted_signals import fits_by, view
from endoscope_explain.pipeline import Inputs, Progress, Sources, explain_case, read_inputs
from endoscope_explain.report.numbers import shown
from endoscope_explain.report.sentences import verdict_sentence
from endoscope_explain.shared_physics import physics_of_inputs

EXPERIMENTS = 4

Play = Callable[[Motion, Path, Path], None]
"""Plays a motion, which a file holds, and records it to a bag."""
Explain = Callable[[Sequence[Path]], Sequence[ExplainedCase]]
"""Explains recordings of one rig together."""
Page = Callable[[Log], str]


class RigStoppedError(EndoscopeError):
    """The rig stopped by itself; the message says why."""


class NotPlayedError(EndoscopeError):
    """A person did not want a motion, or ended it."""


@dataclass(frozen=True)
class Investigation:
    """What is investigated, and how."""

    folder: Path  # of everything that is written
    plant_file: Path  # the described plant
    rig: Rig
    experiments: int = EXPERIMENTS  # at most, after the commissioning motion
    jobs: int = 2

    @property
    def plant(self) -> PlantDescription:
        """The described plant."""
        return load_plant(self.plant_file)


def explain_together(
    bags: Sequence[Path], investigation: Investigation, progress: Progress | None = None
) -> list[ExplainedCase]:
    """Explain bags of one rig, as `explain_inputs` does; BagError if one cannot be used."""
    plant, file = investigation.plant, investigation.plant_file
    inputs = [read_inputs(Sources(bag, plant, quick=True, plant_file=file)) for bag in bags]
    return explain_inputs(inputs, investigation.jobs, progress)


def explain_inputs(
    inputs: Sequence[Inputs], jobs: int, progress: Progress | None = None
) -> list[ExplainedCase]:
    """Explain recordings of one rig: one by itself, several by what all of them need."""
    if len(inputs) > 1:
        all_given = physics_of_inputs(inputs, jobs, progress or (lambda _: None))
        inputs = [
            replace(one, sources=replace(one.sources, given=given))
            for one, given in zip(inputs, all_given, strict=True)
        ]
    return [explain_case(one, jobs=jobs, progress=progress) for one in inputs]


def investigate(
    investigation: Investigation,
    play: Play,
    explain: Explain,
    *,
    page: Page | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Log:
    """Ask a rig for motions until it is explained; continue where a folder's log has ended.

    What is known is in the folder after every step. Interruption and a fault of the rig end it with
    that; Ctrl-C is raised again afterwards, and so is an error of `explain`.
    """
    running = _Running(
        investigation, logs.begun(investigation.folder, investigation.plant_file), page, say
    )
    try:
        first = commissioning(investigation.plant, investigation.rig)
        investigation.folder.mkdir(parents=True, exist_ok=True)
        running.keep(running.log)
        motion = running.answered(explain) if running.log.whole else first
        while not isinstance(motion, Stop):
            running.record(motion, play)
            motion = running.answered(explain)
        running.end(motion, running.why_enough(motion))
    except RigStoppedError as error:
        running.end(Stop.FAULT, str(error))
    except NotPlayedError as error:
        running.end(Stop.INTERRUPTED, str(error))
    except (KeyboardInterrupt, SystemExit):
        running.end(Stop.INTERRUPTED, 'asked for by Ctrl-C or a signal')
        raise
    return running.log


@dataclass
class _Running:
    """An investigation under way."""

    of: Investigation
    log: Log
    page: Page | None
    say: Callable[[str], None]

    def keep(self, log: Log) -> None:
        """Write what is known now."""
        self.log = log
        log.write(self.of.folder)
        if self.page is not None:
            write_text(self.of.folder / logs.PAGE, self.page(log))

    def record(self, motion: Motion, play: Play) -> None:
        """Have a motion played and recorded."""
        require_allowed(motion, self.of.rig)
        number = len(self.log.rounds) + 1
        asked = Round(
            motion.waveform,
            motion.joint,
            motion.why,
            f'motion_{number}.csv',
            motion.duration,
            math.degrees(motion.largest),
            f'bag_{number}',
        )
        file = self.of.folder / asked.file
        write_command_file(file, motion.table.time, motion.table.angle, JOINTS)
        self.keep(replace(self.log, rounds=(*self.log.rounds, asked)))
        self.say(f'{number}. {motion.words}. {motion.why}')
        play(motion, file, self.of.folder / asked.bag)
        self.keep(self.log.with_last(recorded=True))

    def answered(self, explain: Explain) -> Motion | Stop:
        """Explain all recordings together, and say what to ask next, or why nothing."""
        began = time.monotonic()
        whole = self.log.whole
        cases = explain([self.of.folder / each.bag for each in whole])
        best = best_case(cases)
        save_plant(best.plant, self.of.folder / logs.PLANT)
        found = answer_of(cases, best, time.monotonic() - began)
        last = whole[-1]
        rounds = (replace(r, answer=found) if r is last else r for r in self.log.rounds)
        self.keep(replace(self.log, rounds=tuple(rounds)))
        for line in logs.answered(found):
            self.say(line)
        names = _names(cases)
        if not _asks_more(names):
            return Stop.ONE_CLASS
        if len(whole) > self.of.experiments:
            return Stop.USED_UP
        self.say('looking for the motion that tells more')
        played = {(each.motion, each.joint) for each in whole}
        proposed = _proposed(cases, best, names, self.of.jobs, played)
        return Stop.NOTHING_TO_GAIN if proposed is None else of_experiment(proposed)

    def why_enough(self, stop: Stop) -> str:
        """Say why no further motion is asked for."""
        answer = self.log.last_answer
        rivals = [name for name in answer.names if name.rivals] if answer else []
        left = ''.join(f' {r.id} is not told from {" or ".join(r.rivals)}.' for r in rivals[:1])
        count = len(self.log.whole)
        after = f'after {count} motions' if count > 1 else 'after one motion'
        return {
            Stop.ONE_CLASS: f'no name has a rival {after}.',
            Stop.NOTHING_TO_GAIN: f'no safe motion is expected to tell more {after}.{left}',
            Stop.USED_UP: f'no more than {self.of.experiments} experiments were wanted.{left}',
        }[stop]

    def end(self, stop: Stop, words: str) -> None:
        """Note why it ends, and of a motion that was under way, that it is not whole."""
        sentence = f'{logs.STOP_WORDS[stop]}: {words.rstrip(".")}.'
        log = self.log
        if log.rounds and not log.rounds[-1].recorded and stop in (Stop.FAULT, Stop.INTERRUPTED):
            log = log.with_last(ended=sentence)
        self.keep(log.ended(stop, sentence))
        self.say(sentence)


def best_case(cases: Sequence[ExplainedCase]) -> ExplainedCase:
    """The case whose improved plant leaves least of all recordings, by the worst signal."""

    def left(case: ExplainedCase) -> float:
        fits = [fits_by(view(c.recording, {'improved': case.plant}), 'improved') for c in cases]
        return max(fit.ratio for each in fits for fit in each.values())

    fitted = [case for case in cases if case.explanation.fit]
    return min(fitted, key=left) if len(fitted) > 1 else (fitted or list(cases))[0]


def answer_of(cases: Sequence[ExplainedCase], best: ExplainedCase, seconds: float) -> Answer:
    """What all recordings say together."""
    fit = best.explanation.fit
    worst = [
        max((each.ratio for each in fit[name].values()), default=None) if name in fit else None
        for name in ('nominal', 'augmented')
    ]
    names = tuple(Name(e.id, e.joint, e.alternatives, _strength(e)) for e in _names(cases))
    return Answer(str(best.verdict), verdict_sentence(best), names, worst[0], worst[1], seconds)


def _strength(effect: NamedEffect) -> str:
    first = effect.definition.parameters[0].name
    return str(shown(first, effect.parameters[first])) if first in effect.parameters else ''


def _names(cases: Sequence[ExplainedCase]) -> list[NamedEffect]:
    """Effects of all recordings, each once, as the recording has it that tells its size best."""
    found: dict[tuple[str, str], NamedEffect] = {}
    for effect in (each for case in cases for each in case.effects):
        key = effect.id, effect.joint
        if key not in found or _width(effect) < _width(found[key]):
            found[key] = effect
    return list(found.values())


def _width(effect: NamedEffect) -> float:
    first = effect.parameters.get(effect.definition.parameters[0].name)
    return math.inf if first is None else first.high - first.low


def _asks_more(names: Sequence[NamedEffect]) -> bool:
    return any(is_wide(e) or any(a in KNOWN for a in e.alternatives) for e in names)


def _proposed(
    cases: Sequence[ExplainedCase],
    best: ExplainedCase,
    names: Sequence[NamedEffect],
    jobs: int,
    played: set[tuple[str, str]],
) -> NextExperiment | None:
    """The motion that tells rivals apart, or that narrows a wide interval where none has any."""
    recordings = [case.recording for case in cases]
    longest = max(recordings, key=lambda one: one.command.time[-1] - one.command.time[0])
    plant = best.explanation.augmented
    there = {(spec.id, spec.joint) for spec in plant.effects}
    known = [e for e in names if (e.id, e.joint) in there]
    left = _left(best)
    for effect in known:
        found = propose(longest, plant, effect, jobs, played, left)
        if found is not None:
            return found
    others = [longest, *(one for one in recordings if one is not longest)]
    for effect in filter(is_wide, known):
        found = narrow(others, plant, effect, jobs, played)
        if found is not None:
            return found
    return None


def _left(case: ExplainedCase) -> float:
    """What the improved plant leaves of a recording, in its noise (rms over signals)."""
    ratios = [fit.ratio for fit in case.explanation.fit.get('augmented', {}).values()]
    return float(np.sqrt(np.mean(np.square(ratios)))) if ratios else 1.0
