"""The loop: a motion, what all recordings show together, and the motion that would show more."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from endoscope_core.atomic_output import write_text
from endoscope_core.errors import NotPlayedError, RigStoppedError
from endoscope_core.investigation_folder import PAGE
from endoscope_core.names import JOINTS
from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.plant_file import load_plant, save_plant
from endoscope_core.rig import Rig
from endoscope_core.signals.sampled_motion import write_command_file
from endoscope_explain.case import ExplainedCase, Sources
from endoscope_explain.design import deciding, is_wide, what_is_asked
from endoscope_explain.explanation import NamedEffect, Verdict
from endoscope_explain.investigation import log as logs
from endoscope_explain.investigation.log import COMMISSIONING, Log, Name, RigAnswer, Round, Stop
from endoscope_explain.investigation.motions import (
    MotionRefusedError,
    PlayThrough,
    RigMotion,
    calibration,
    commissioning,
    held_out,
    of_experiment,
    require_allowed,
    with_tracking,
)
from endoscope_explain.open_questions import open_questions
from endoscope_explain.operator_changes import what_would_decide
from endoscope_explain.pipeline import Progress, explain_case, read_inputs
from endoscope_explain.prediction_set import OTHER_NUMBERS
from endoscope_explain.report.left_open import in_words
from endoscope_explain.report.numbers import shown
from endoscope_explain.report.sentences import verdict_sentence, where
from endoscope_explain.search.term import Known
from endoscope_explain.takes import inputs_joined

EXPERIMENTS = 4

Play = Callable[[RigMotion, Path, Path], None]
"""Plays a motion, which a file holds, and records it to a bag."""
KnownOfRig = Mapping[str, Known]
"""By joint, what was given or left open before."""
Explain = Callable[[Sequence[Path], KnownOfRig], ExplainedCase]
"""Explains recordings of one rig together, with what is known from some of them."""
Page = Callable[[Log], str]


@dataclass(frozen=True)
class Investigation:
    """What is investigated, and how."""

    folder: Path  # of everything that is written
    plant_file: Path  # the described plant
    rig: Rig
    experiments: int = EXPERIMENTS  # at most, after the calibration
    jobs: int = 2

    @property
    def plant(self) -> PlantDescription:
        """The described plant."""
        return load_plant(self.plant_file)


def explain_together(
    bags: Sequence[Path],
    known: KnownOfRig,
    investigation: Investigation,
    progress: Progress | None = None,
) -> ExplainedCase:
    """Explain bags of one rig as one recording; BagError if one cannot be used."""
    plant, file, jobs = investigation.plant, investigation.plant_file, investigation.jobs
    sources = Sources(bags[0], plant, quick=True, jobs=jobs, plant_file=file, known=known)
    inputs = [read_inputs(sources)]
    for bag in bags[1:]:
        inputs.append(read_inputs(replace(sources, bag=bag), inputs[-1].audit))
    return explain_case(inputs_joined(inputs), progress=progress)


def investigate(
    investigation: Investigation,
    play: Play,
    explain: Explain,
    *,
    track: PlayThrough | None = None,
    page: Page | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> Log:
    """Ask a rig for motions until it is explained; continue where a folder's log has ended."""
    # With `track` a motion that is among no experiments then shows what the improved plant is good
    # for. What is known is in the folder after every step. Interruption and a fault of the rig end
    # it with that; Ctrl-C and any other error are raised again afterwards.
    running = _Running(
        investigation, logs.begun(investigation.folder, investigation.plant_file), page, report
    )
    try:
        first = calibration(investigation.plant, investigation.rig)
        investigation.folder.mkdir(parents=True, exist_ok=True)
        running.keep(running.log)
        motion = running.answered(explain) if running.log.whole else first
        while not isinstance(motion, Stop):
            running.record(motion, play)
            motion = running.answered(explain)
        running.end(motion, running.why_enough(motion))
        answer = running.log.last_answer
        if track is not None and answer is not None and answer.improved is not None:
            running.follow(track)
    except RigStoppedError as error:
        running.end(Stop.FAULT, str(error))
    except NotPlayedError as error:
        running.end(Stop.INTERRUPTED, str(error))
    except (KeyboardInterrupt, SystemExit):
        running.end(Stop.INTERRUPTED, 'asked for by Ctrl-C or a signal')
        raise
    except Exception as error:
        running.end(Stop.FAILED, str(error) or type(error).__name__)
        raise
    return running.log


@dataclass
class _Running:
    """An investigation under way."""

    of: Investigation
    log: Log
    page: Page | None
    report: Callable[[str], None]
    would_decide: str = ''  # what would, where no motion does

    def keep(self, log: Log) -> None:
        """Write what is known now."""
        self.log = log
        log.write(self.of.folder)
        if self.page is not None:
            write_text(self.of.folder / PAGE, self.page(log))

    def record(self, motion: RigMotion, play: Play) -> None:
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
        self.report(f'{number}. {motion.words}. {motion.why}')
        began = time.monotonic()
        play(motion, file, self.of.folder / asked.bag)
        self.keep(self.log.with_last(recorded=True, played_s=time.monotonic() - began))

    def answered(self, explain: Explain) -> RigMotion | Stop:
        """Explain all recordings together, and work out what to ask next, or why nothing."""
        began = time.monotonic()
        whole = self.log.whole
        case = explain([self.of.folder / each.bag for each in whole], self.known())
        save_plant(case.plant, self.of.folder / logs.PLANT)
        found = answer_of(case, time.monotonic() - began)
        self.keep(self.log.with_whole(answer=found))
        for line in logs.answered(found):
            self.report(line)
        played = {(each.motion, each.joint) for each in whole}
        commissioned = any(motion == COMMISSIONING for motion, _ in played)
        unnamed = case.verdict == Verdict.UNKNOWN_PHYSICS and not commissioned
        if not (unnamed or open_questions(case)):
            return Stop.ONE_CLASS
        if len(whole) > self.of.experiments:
            return Stop.USED_UP
        self.report('looking for the motion that decides more')
        began = time.monotonic()
        asked = what_is_asked(case)
        decides = deciding(asked, self.of.jobs, played)
        motion = None if decides is None else of_experiment(decides)
        if motion is None and not commissioned:
            motion = self.commissioned(case.plant)
        if motion is None:
            self.would_decide += what_would_decide(asked, self.of.jobs)
        self.keep(self.log.with_whole(proposed_s=time.monotonic() - began))
        return motion or Stop.NOTHING_TO_GAIN

    def commissioned(self, improved: PlantDescription) -> RigMotion | None:
        """The commissioning motion, as large as described and improved plant allow."""
        try:
            return commissioning(self.of.plant, self.of.rig, improved)
        except MotionRefusedError as error:
            self.would_decide = f'But {error}. '
            return None

    def known(self) -> KnownOfRig:
        """What was given or left open so far, and the numbers of what was given last."""
        found: dict[str, dict[str, Mapping[str, float]]] = {
            joint: {key: {} for key in sorted(names)} for joint, names in self.log.known().items()
        }
        file = self.of.folder / logs.PLANT
        for spec in load_plant(file).effects if file.exists() else ():
            if spec.id in found.get(spec.joint, {}):
                found[spec.joint][spec.id] = spec.parameters
        return found

    def follow(self, track: PlayThrough) -> None:
        """See how the tip follows by the described and by the improved plant."""
        of = self.of
        motion = held_out(of.plant, of.rig)
        self.report(f'{motion.words}, by the described plant and by the improved one. {motion.why}')
        self.keep(with_tracking(self.log, of.folder, of.plant_file, motion, of.rig, track))
        self.report(logs.tracking(self.log))

    def why_enough(self, stop: Stop) -> str:
        """Say why no further motion is asked for."""
        answer = self.log.last_answer
        rivals = [name for name in answer.names if name.rivals] if answer else []
        left = ''.join(f' {r.id} is confounded with {" or ".join(r.rivals)}.' for r in rivals[:1])
        wide = [name for name in answer.names if name.wide] if answer else []
        left += ''.join(f' How strong {w.id} is stays open: {w.strength}.' for w in wide)
        count = len(self.log.whole)
        after = f'after {count} motions' if count > 1 else 'after one motion'
        unnamed = answer is not None and answer.verdict == Verdict.UNKNOWN_PHYSICS
        left += ' What is missing has no name.' if unnamed else ''
        return {
            Stop.ONE_CLASS: f'no other name is left open {after}.{left}',
            Stop.NOTHING_TO_GAIN: f'no safe motion is expected to decide more {after}.{left}'
            f'{self.would_decide and " "}{self.would_decide}',
            Stop.USED_UP: f'no more than {self.of.experiments} experiments were wanted.{left}',
        }[stop]

    def end(self, stop: Stop, words: str) -> None:
        """Note why it ends, and of a motion that was under way, that it is not whole."""
        sentence = f'{logs.STOP_WORDS[stop]}: {words.rstrip(".")}.'
        log = self.log
        if log.rounds and not log.rounds[-1].recorded and stop in logs.CUT_SHORT:
            log = log.with_last(ended=sentence)
        self.keep(replace(log, stopped=stop, words=sentence))
        self.report(sentence)
        for line in logs.times(self.log):
            self.report(line)


def answer_of(case: ExplainedCase, seconds: float) -> RigAnswer:
    """What all recordings show together."""
    explanation = case.explanation
    fit = explanation.fit
    worst = [
        max((each.ratio for each in fit[name].values()), default=None) if name in fit else None
        for name in ('nominal', 'augmented')
    ]
    names = [
        Name(e.id, e.joint, e.alternatives, _strength(e), is_wide(e), in_words(e.left_open))
        for e in case.effects
    ]
    # What may be missing where no more than other numbers is found to be.
    names += [
        Name(OTHER_NUMBERS, joint, rivals, '', left_open=in_words(explanation.left_open(joint)))
        for joint in explanation.contests
        if (rivals := explanation.instead(joint))
    ]
    sentence = verdict_sentence(case)
    places = tuple(where(place) for place in case.places)
    return RigAnswer(str(case.verdict), sentence, tuple(names), worst[0], worst[1], seconds, places)


def _strength(effect: NamedEffect) -> str:
    first = effect.definition.parameters[0].name
    return str(shown(first, effect.parameters[first])) if first in effect.parameters else ''
