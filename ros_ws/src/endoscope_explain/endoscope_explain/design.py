"""The short motion that decides most per second between what an answer leaves open.

What is left open are laws, each with a probability and with numbers that the recordings know to
some precision. For every safe motion of a library, the evidence that it is expected to bring for
the law that is true over each of the others, refitted within that precision, is weighted by their
probabilities (Box, Hill, Technometrics 9, 1967). The refit is linear (Buzzi-Ferraris, Forzatti,
Chem. Eng. Sci. 38, 1983). Something that nobody has a name for stands beside them: it shows where a
motion makes what no recording has made, so that an experiment is chosen where no model that is
compared is right, too (expected discriminatory information: arXiv 2304.07949).
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations

import numpy as np

from endoscope_core.names import JOINTS
from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.effects import KNOWN
from endoscope_core.physics.simulator import TICK
from endoscope_core.workers import parallel_map
from endoscope_explain.case import ExplainedCase, NextExperiment
from endoscope_explain.experiment_motions import SMALLEST, Segment, answer_to, is_safe, library
from endoscope_explain.explanation import NamedEffect
from endoscope_explain.fit.model import JointModel, jacobian
from endoscope_explain.observe.observation import JointObservation, commanded
from endoscope_explain.observe.revisits import Visited
from endoscope_explain.open_questions import (
    DECIDED,
    OpenQuestion,
    coordinates,
    fitted_laws,
    free_numbers,
    observed,
    open_questions,
)
from endoscope_explain.prediction_set import NOTHING, OTHER_NUMBERS, SOMETHING_ELSE
from endoscope_explain.recording import Array, RigRecording

Played = Collection[tuple[str, str]]
"""Motions and the joints that they moved."""
Changed = Callable[[PlantDescription, str], PlantDescription]
"""Changes one joint of a plant."""

MARGIN = 1.15
"""How far a proposed motion may go beyond the tensions and angles that were recorded."""
LEAST_NATS = 3.0
"""Evidence in nats, as the posterior reads it, that a motion must be expected to bring: odds of 20
to 1."""
HALVED = 0.5
"""Share of an interval's width that a motion must leave at most to be worth it: the recording made
once more leaves 0.7."""
_UNBOUNDED = 1e-6
"""Precision of a coordinate of which nothing is known: a spread of a thousand."""
WIDE = 0.25
"""Half width of a strength's 90 % interval, as a share of it, that is worth another motion."""


def what_is_asked(case: ExplainedCase) -> list['Asking']:
    """All that a case leaves open, each law fitted: the most of what a proposal costs."""
    return [Asking.of(case, question) for question in open_questions(case)]


def propose(case: ExplainedCase, asked: Sequence['Asking'], jobs: int = 1) -> NextExperiment | None:
    """The motion that decides most per second of what is asked about a case, if any does."""
    # Where nothing but a strength is open, it is the motion that narrows its interval.
    decides = deciding(asked, jobs)
    if decides is not None:
        return decides
    there = {(spec.id, spec.joint) for spec in case.explanation.augmented.effects}
    for effect in filter(is_wide, case.effects):
        if (effect.id, effect.joint) in there:
            found = narrow(case, effect, jobs)
            if found is not None:
                return found
    return None


def deciding(
    asked: Sequence['Asking'], jobs: int = 1, played: Played = ()
) -> NextExperiment | None:
    """The motion that decides most per second between names, if any does."""
    found = [best for each in asked if (best := each.best(jobs, played)) is not None]
    return max(found, key=lambda each: each.per_second).experiment() if found else None


@dataclass(frozen=True)
class _Law:
    """A law that is left open, and how well the recordings know its numbers."""

    plant: PlantDescription
    model: JointModel  # of one joint, on the recordings
    precision: Array  # (n, n), of its free numbers' coordinates

    @property
    def noise(self) -> dict[str, float]:
        """Noise of the recordings by signal, in its unit by the root of the samples in a s."""
        seen = self.model.observation
        return {
            c.signal: float(np.sqrt(np.mean(c.noise**2) * seen.duration / len(c.time)))
            for c in seen.channels
        }

    def once(self, changed: Changed, unknown: str) -> '_Law':
        """The law of a rig that was changed, of which one number is not known any more."""
        joint = self.model.observation.joint
        plant, known = changed(self.plant, joint), self.precision.copy()
        base, flags, free = free_numbers(plant, joint)
        for k, item in enumerate(free):
            if item.name == unknown:
                # What the others are known to once that one may be anything (Schur complement).
                known -= np.outer(known[k], known[k]) / known[k, k]
                known[k, :] = known[:, k] = 0.0
                known[k, k] = self.model.prior_weight()[k] ** 2 + _UNBOUNDED
        model = replace(self.model, base=base, flags=flags, free=free)
        return replace(self, plant=plant, model=model, precision=known)

    def reads(self, imagined: RigRecording) -> JointObservation:
        """What the joint reads in an imagined motion, with the noise of the recordings."""
        own = observed(imagined, self.plant, self.model.observation.joint)
        noise = self.noise
        rates = {c.signal: len(c.time) / own.duration for c in own.channels}
        channels = tuple(
            replace(c, noise=np.full_like(c.noise, noise[name] * math.sqrt(rates[name])))
            for c in own.channels
            if (name := c.signal) in noise
        )
        return replace(own, channels=channels)

    def slopes(self, observation: JointObservation) -> Array:
        """Derivatives (size, n) of what it reads in another motion, in noise units."""
        at = coordinates(self.model.base, self.model.free)
        return jacobian(replace(self.model, observation=observation), at)


def _law(recording: RigRecording, plant: PlantDescription, joint: str) -> _Law:
    base, flags, free = free_numbers(plant, joint)
    seen = observed(recording, plant, joint)
    law = _Law(plant, JointModel(seen, base, flags, free), np.empty((0, 0)))
    slopes = law.slopes(seen)
    prior = np.diag(law.model.prior_weight() ** 2 + _UNBOUNDED)
    return replace(law, precision=slopes.T @ slopes + prior)


@dataclass(frozen=True)
class BestMotion:
    """A motion, and what it is expected to bring."""

    question: OpenQuestion
    joints: tuple[str, ...]  # of the rig
    segment: Segment
    nats: float
    per_second: float  # nats up to what decides
    distances: Mapping[str, float]  # of all motions that were looked at closely

    def experiment(self) -> NextExperiment:
        """As a report has it."""
        joint, names = self.segment.joint, [n for n in self.question.chances if n != SOMETHING_ELSE]
        what = ' from '.join(names) if len(names) > 1 else f'{names[0]} from what has no name'
        why = (
            f'{self.segment.name.capitalize()} of {joint}, {self.segment.duration:.0f} s, is '
            f'expected to distinguish {what} by {self.nats:.0f} nats.'
        )
        return _experiment(
            self.segment, self.joints, why, tuple(self.question.chances), self.distances
        )


@dataclass(frozen=True)
class LawsOfJoint:
    """Laws that one joint of a rig may have, and what it would read by each in a motion."""

    recording: RigRecording
    laws: Mapping[str, _Law]

    @cached_property
    def limits(self) -> tuple[Array, Array, Array] | None:
        """What the rig has been through; see `_limits`."""
        return _limits(self.recording)

    def not_played(self, joint: str, played: Played = ()) -> list[Segment]:
        """Motions of a joint that were not played yet; none where no limits are known."""
        if self.limits is None:
            return []
        within = _within(self.recording, joint)
        return [each for each in within if (each.name, each.joint) not in played]

    def seen(self, full: Segment) -> tuple[Segment, dict[str, JointObservation]]:
        """A motion as large as is safe by all laws, and what each reads; empty where none is."""
        size = 1.0
        while self.limits is not None and size >= SMALLEST:
            segment = replace(full, angle=size * full.angle)
            answers = {}
            for name, law in self.laws.items():
                imagined = answer_to(
                    law.plant, segment.name, segment.time, segment.angle, self.recording.rig
                )
                if not is_safe(imagined, *self.limits):
                    break
                answers[name] = law.reads(imagined)
            else:
                return segment, answers
            size *= 0.7
        return full, {}


@dataclass(frozen=True)
class Asking(LawsOfJoint):
    """A question, and what is needed to judge a motion by it."""

    question: OpenQuestion

    @staticmethod
    def of(case: ExplainedCase, question: OpenQuestion) -> 'Asking':
        """A question of a case, its laws fitted."""
        laws = {
            name: _law(case.recording, plant, question.joint)
            for name, plant in fitted_laws(case, question).items()
        }
        chances = {n: p for n, p in question.chances.items() if n in laws}
        # What no plant can have has no name as far as motions go.
        tried = {*KNOWN, NOTHING, OTHER_NUMBERS, *laws}
        unnamed = sum(p for n, p in question.chances.items() if n not in tried)
        if unnamed > 0.0:
            chances[SOMETHING_ELSE] = unnamed
        return Asking(case.recording, laws, replace(question, chances=chances))

    @cached_property
    def made(self) -> Visited:
        """The branches of the joint's command that the recordings have passed."""
        column = self.recording.joints.index(self.question.joint)
        return Visited.by(commanded(self.recording)[:, column] / self.recording.gear)

    def once(self, changed: Changed, unknown: str = '') -> 'Asking':
        """The same on a rig that was changed in a known way, but for one number of it."""
        laws = {name: law.once(changed, unknown) for name, law in self.laws.items()}
        return replace(self, laws=laws)

    def best(self, jobs: int, played: Played) -> BestMotion | None:
        """The motion that is expected to decide most per second; None where none brings enough."""
        question = self.question
        if not self.laws or len(question.chances) < 2:
            return None
        seen = parallel_map(self.seen, self.not_played(question.joint, played), jobs)
        # Refitting a law brings it nearer: what is apart before is more than what is apart after.
        rough = [
            (question.brings(self._apart(*each), each[0].duration)[1], *each)
            for each in seen
            if each[1]
        ]
        best: BestMotion | None = None
        distances: dict[str, float] = {}
        for most, segment, answers in sorted(rough, key=lambda each: -each[0]):
            if best is not None and most <= best.per_second:
                break
            apart = self._apart(segment, answers, refitted=True)
            distances[segment.name] = _rms(apart, answers)
            nats, per_second = question.brings(apart, segment.duration)
            if nats >= LEAST_NATS and (best is None or per_second > best.per_second):
                best = BestMotion(question, self.recording.joints, segment, nats, per_second, {})
        return None if best is None else replace(best, distances=distances)

    def _apart(
        self, segment: Segment, answers: Mapping[str, JointObservation], *, refitted: bool = False
    ) -> dict[tuple[str, str], float]:
        """Evidence in nats for each law, if it is true, over each of the others."""
        apart: dict[tuple[str, str], float] = {}
        slopes = {n: self.laws[n].slopes(answers[n]) for n in self.laws if refitted}
        read = {
            n: np.concatenate([c.value / c.noise for c in o.channels]) for n, o in answers.items()
        }
        for true, other in permutations(self.laws, 2):
            missed = read[other] - read[true]
            squares = float(missed @ missed)
            if refitted:
                towards = slopes[other].T @ missed
                curvature = slopes[other].T @ slopes[other] + self.laws[other].precision
                squares -= float(towards @ np.linalg.solve(curvature, towards))
            apart[true, other] = 0.5 * max(0.0, squares)
        if SOMETHING_ELSE in self.question.chances:
            decides = DECIDED * self.question.temperature(segment.duration)
            shown = self._newly_visited(segment) * decides
            for name in self.laws:
                apart[name, SOMETHING_ELSE] = apart[SOMETHING_ELSE, name] = shown
        return apart

    def _newly_visited(self, segment: Segment) -> float:
        """Share of a motion that no recording has made: a law of no name may show there."""
        column = self.recording.joints.index(self.question.joint)
        ticks = np.arange(0.0, segment.duration, TICK)
        return self.made.newly(np.interp(ticks, segment.time, segment.angle[:, column]))


def _rms(apart: Mapping[tuple[str, str], float], answers: Mapping[str, JointObservation]) -> float:
    """The least evidence between laws that have a name, as a distance in noise units (rms)."""
    named = [nats for pair, nats in apart.items() if SOMETHING_ELSE not in pair]
    return math.sqrt(2.0 * min(named, default=0.0) / max(o.size for o in answers.values()))


def _within(recording: RigRecording, joint: str) -> tuple[Segment, ...]:
    """Motions of a joint, each joint as far as it was commanded."""
    most = np.abs(recording.command.values).max(axis=0) / recording.gear
    reaches = tuple(zip(recording.joints, np.round(most, 3).tolist(), strict=True))
    return library(joint, reaches, recording.rig)


def _limits(recording: RigRecording) -> tuple[Array, Array, Array] | None:
    """Tensions (J, 2) in N, angles (J,) in rad and least tensions that the rig has been through."""
    # None where a joint was never seen.
    seen = recording.bending
    if not np.all(np.any(seen.valid, axis=0)):
        return None
    bending = MARGIN * np.max(np.abs(seen.values), axis=0, where=seen.valid, initial=0.0)
    ceiling = np.full((len(recording.joints), 2), recording.rig.tension.calibration_ceiling)
    wires = recording.tension
    if wires is None or not np.all(np.any(wires.valid, axis=0)):
        return ceiling, bending, np.zeros_like(ceiling)
    most = np.max(wires.values, axis=0, where=wires.valid, initial=0.0)
    least = np.min(wires.values, axis=0, where=wires.valid, initial=np.inf)
    return np.minimum(ceiling, MARGIN * most), bending, np.maximum(least, 0.0)


def _experiment(
    segment: Segment,
    joints: tuple[str, ...],
    why: str,
    separates: tuple[str, ...],
    distances: Mapping[str, float],
) -> NextExperiment:
    columns = np.zeros((len(segment.time), len(JOINTS)))
    for k, joint in enumerate(joints):
        columns[:, JOINTS.index(joint)] = segment.angle[:, k]
    return NextExperiment(
        why,
        separates,
        segment.name,
        segment.joint,
        distances,
        tuple(map(float, segment.time)),
        tuple((float(row[0]), float(row[1])) for row in columns),
        JOINTS,
    )


def is_wide(effect: NamedEffect) -> bool:
    """Whether the strength of an effect is known by no more than its order of magnitude."""
    first = effect.parameters.get(effect.definition.parameters[0].name)
    return first is not None and 0.5 * (first.high - first.low) > WIDE * abs(first.value)


def narrow(case: ExplainedCase, effect: NamedEffect, jobs: int = 1) -> NextExperiment | None:
    """The safe motion that halves the interval of a strength soonest; None where none does."""
    # The precision is what the recordings and the motion have of it together, by white noise (Box,
    # Lucas, Biometrika 46, 1959).
    recording, plant = case.recording, case.explanation.augmented
    law = _law(recording, plant, effect.joint)
    strength = [k for k, i in enumerate(law.model.free) if i.index == effect.definition.places[0]]
    if not strength:
        return None
    alone = LawsOfJoint(recording, {effect.id: law})

    def deviation(known: Array) -> float:
        return float(np.sqrt(np.linalg.inv(known)[strength[0], strength[0]]))

    def left(full: Segment) -> tuple[float, Segment]:
        segment, answers = alone.seen(full)
        if not answers:
            return 1.0, segment
        slopes = law.slopes(answers[effect.id])
        return deviation(law.precision + slopes.T @ slopes) / deviation(law.precision), segment

    motions = alone.not_played(effect.joint)
    halving = [each for each in parallel_map(left, motions, jobs) if each[0] <= HALVED]
    if not halving:
        return None
    share, best = min(halving, key=lambda each: math.log(each[0]) / each[1].duration)
    name = effect.definition.parameters[0].name
    why = (
        f'{best.name.capitalize()} of {best.joint}, {best.duration:.0f} s, would leave {share:.0%} '
        f'of the interval of {name} of {effect.id}.'
    )
    return _experiment(best, recording.joints, why, (effect.id,), {})
