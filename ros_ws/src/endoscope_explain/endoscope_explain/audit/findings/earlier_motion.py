"""What the rig had done before the recording began, as far as it still shows.

Friction remembers the last reversals of the motor until greater motion wipes them out (return-point
memory), and of the least one: the tension of a wire that goes back a little falls as the square
root of how far, so that millionths of a rad by which a servo overshot still show. Where the
readings are not those of a rig that came straight from zero, the reversals that explain them best
are taken for its past, and what depends on the past is not judged, if enough is left without it or
if only that part is not as the plant says. Of a motor that was turning already, angle and speed are
estimated; what no speed explains is not judged until its servo has forgotten it.
"""

from dataclasses import dataclass, field, replace
from math import log, log2
from typing import Any

import numpy as np
from scipy.optimize import minimize

from endoscope_core.physics.kernel import run_joints
from endoscope_core.physics.layout import MOTOR_BANDWIDTH, OUTPUTS
from endoscope_core.physics.packing import rest_state
from endoscope_explain.audit.examined import Examined, without_times
from endoscope_explain.audit.finding import FindingKind, Severity
from endoscope_explain.observe.observation import ANALYSIS_PERIOD, JointObservation, observe
from endoscope_explain.observe.predicted_signals import packed_rig
from endoscope_explain.recording import LEAST_DURATION_S, MOVES_RAD, Array, Mask, RigRecording

NOT_JUDGED = FindingKind(
    'earlier_motion',
    Severity.NOTE,
    '{signals} had moved before the recording began, which shows until {end:.2f} s',
    'what is before {end:.2f} s is not judged',
)
ESTIMATED = replace(
    NOT_JUDGED, remedy='the state at the start is estimated, and all is judged from it'
)
AT_REST_S = 0.1
"""For which a rig is read at the end of one recording and at the beginning of the next."""
AS_LEFT = 0.1
"""Share of its range by which a tension may creep or drift between two recordings: a motion in
between that comes back leaves it anywhere in its hysteresis, a third of the range and more."""
MOST_REVERSALS = 5
SHORTEST = 1e-6
"""Way back in rad, from where the motor stands, of the smallest reversals that are tried."""
STEPS = 40
"""Of the search that goes on from the best of them, for each number."""
SEARCH = 'Nelder-Mead'
EXTREMES = np.array([np.finfo(float).eps, 1.0])
"""Ways back that the search may come to, over twice the motor's reach."""
FLIGHT = np.array([1e-3, 0.1])
"""Angle in rad and speed in rad/s by which that search begins to move a motor that is turning."""


def find(seen: Examined) -> Examined:
    """Estimate as its `start` from where the motors had come when a recording began."""
    # The time until it no longer shows by more than the noise is left out, if enough is left.
    recording = seen.recording
    if seen.before is not None and _is_as_left(seen.before.recording, recording):
        return seen
    observations = observe(recording, seen.plant)
    parameters, flags = packed_rig(observations, seen.plant)
    begin = float(recording.command.time[0])
    reach = recording.rig.motors.reach
    starts, speeds, left_out, found = [], [], [], []
    for j, observation in enumerate(observations):
        way, speed, unjudged = observation.start, 0.0, 0.0
        if observation.channels:
            shaft = recording.shaft_position
            at = observation.start if shaft is None else shaft.values[:1, j]
            past = _Past(observation, parameters[j], flags[j], float(at[0]), reach)
            start, came_straight = past.estimated()
            way, speed = past.came(start)
            end = unjudged = begin + start.turns_until
            if not came_straight:
                end = begin + past.shows_until
                if _is_enough(recording, j, end) or past.alone_is_unexplained(start):
                    unjudged = end
            if not came_straight or start.turns_until:
                kind, joint = ESTIMATED if unjudged < end else NOT_JUDGED, observation.joint
                backs = {f'reversal_{k}_rad': float(a) for k, a in enumerate(way[:-1], start=1)}
                note = kind.found(recording, (joint,), [(begin, end)], joint=joint, evidence=backs)
                found.append(note)
        starts.append(way)
        speeds.append(speed)
        left_out.append(unjudged)
    longest = max(map(len, starts))
    # To stay where it has come to adds nothing to a way.
    ways = [np.pad(way, (0, longest - len(way)), mode='edge') for way in starts]
    recording = replace(recording, start=np.stack(ways), start_speed=np.array(speeds))
    return seen.found(
        *found, recording=without_times(recording, lambda t: t[:, None] < np.array(left_out))
    )


def _is_as_left(before: RigRecording, recording: RigRecording) -> bool:
    """Whether a rig reads at first what it read at the end of the recording before."""
    # Tensions remember where the motors have been, and without them the tip does.
    for name in ('tension', 'bending'):
        last, first = before.measured().get(name), recording.measured().get(name)
        if last is None or first is None:
            continue
        # Columns of which nothing is seen at either moment are masked.
        was, now = (np.ma.array(s.values, mask=~s.valid) for s in (last, first))
        ended = was[last.time >= last.time[-1] - AT_REST_S].mean(axis=0)
        moved = np.ma.abs(now[first.time <= first.time[0] + AT_REST_S].mean(axis=0) - ended)
        if moved.count():
            # A joint that stood still is allowed as much as the one that moved.
            span = max(float(np.ma.ptp(readings, axis=0).max()) for readings in (was, now))
            return bool((moved <= AS_LEFT * span).all())
    return False


class _Past:
    """What one joint's past does to its readings, by the plant as described."""

    def __init__(
        self, observation: JointObservation, packed: Array, on: Mask, seen: float, reach: float
    ) -> None:
        self._observation, self._packed, self._on = observation, packed, on
        self._reach = reach
        self._times = times = np.concatenate([c.time for c in observation.channels])
        shaft = np.concatenate(
            [np.full(len(c.time), c.quantity == 'shaft_position') for c in observation.channels]
        )
        asked = float(observation.start[-1])
        first_seen, first_speed = self._motion(seen)
        ends = [asked, seen, first_seen + first_speed / float(packed[MOTOR_BANDWIDTH])]

        def resting(way: list[float]) -> _Start:
            return _Start(np.array([way[-1], 0.0]), np.array(way[:-1]) - way[-1])

        def differ_until(low: list[float], high: list[float], of: Mask | None = None) -> float:
            apart = np.abs(self._left(resting(high)) - self._left(resting(low))) >= 1.0
            last = float(times[apart if of is None else apart & of].max(initial=-1.0))
            return last + observation.tick if last >= 0.0 else 0.0

        turns_until = differ_until([min(ends)], [max(ends)], shaft)
        first = shaft & (times < turns_until)
        count, short = max(int(first.sum()), 1), self._cut_at(turns_until)

        def left(start: _Start) -> float:
            return float(np.sum(self._left(start, short)[first] ** 2)) / count

        def judged(start: _Start) -> _Start:
            """What leaves no more than noise of a motor is judged from the beginning."""
            return replace(start, turns_until=turns_until if left(start) > 1.0 else 0.0)

        # A motor that rested where it was sent or where it was read, or one that was turning.
        rests = [_Start(np.array([angle, 0.0])) for angle in (asked, seen)]
        self._begins = [judged(min(rests, key=left))]
        if turns_until:
            turning = np.array([first_seen, first_speed])
            options = _around(turning, FLIGHT)
            found = minimize(lambda n: left(_Start(n)), turning, method=SEARCH, options=options)
            self._begins.append(judged(_Start(found.x)))
        # Whatever the rig did before, its state lies between those of its greatest excursions.
        self.shows_until = differ_until([-reach, min(ends)], [reach, max(ends)])
        self._cut = self._cut_at(self.shows_until)

    def _cut_at(self, end: float) -> JointObservation:
        """The observation with the inputs that its samples before `end` s need."""
        # Samples are means over a period, half of which may come after their time.
        ticks = int(np.ceil((end + ANALYSIS_PERIOD) / self._observation.tick)) + 2
        return replace(self._observation, inputs=self._observation.inputs[:, :ticks])

    def _motion(self, seen: float) -> tuple[float, float]:
        """Angle in rad and speed in rad/s of the motor at first, as read."""
        shaft = next(
            (c for c in self._observation.channels if c.quantity == 'shaft_position'), None
        )
        if shaft is None or len(shaft.time) < 2:
            return seen, 0.0
        first, second = shaft.value[:2].tolist()
        speed = (second - first) / float(shaft.time[1] - shaft.time[0])
        return first, speed

    def _left(self, start: '_Start', observation: JointObservation | None = None) -> Array:
        """Residuals (size,) in noise units."""
        seen = observation or self._observation
        packed, on = self._packed[None], self._on[None]
        out = np.empty((1, seen.inputs.shape[1], OUTPUTS))
        way, speed = self.came(start)
        begun = rest_state(packed, on, seen.tick, way[None], np.array([speed]))
        run_joints(*begun, packed, on, seen.inputs, False, seen.tick, out)
        ends = np.full((1, self._observation.inputs.shape[1] - out.shape[1], OUTPUTS), np.nan)
        outputs = np.concatenate([out, ends], axis=1)[0]
        return np.concatenate(
            [(c.predicted(outputs) - c.value) / c.noise for c in self._observation.channels]
        )

    def _early(self, start: '_Start') -> Mask:
        """Samples that show the past."""
        return (self._times >= start.turns_until) & (self._times < self.shows_until)

    def alone_is_unexplained(self, start: '_Start') -> bool:
        """Whether the readings differ from the plant's while the past shows, and not after it."""
        left = self._left(start) ** 2
        early, later = left[self._early(start)], left[self._times >= self.shows_until]
        if not len(later):
            return False
        return _is_more_than_noise(early) and not _is_more_than_noise(later)

    def _leaves_more_than_noise(self, start: '_Start') -> bool:
        squares, early = self._left(start, self._cut) ** 2, self._early(start)
        parts = [squares[part][early[part]] for part in self._observation.slices()]
        return any(len(each) and _is_more_than_noise(each) for each in parts)

    def _misfit(self, start: '_Start') -> float:
        """Mean square of the samples that show the past."""
        return float(np.mean(self._left(start, self._cut)[self._early(start)] ** 2))

    def estimated(self) -> tuple['_Start', bool]:
        """From where the motor had come, and whether it may have come straight."""
        tried: list[tuple[_Start, bool]] = []
        for begun in self._begins:
            if not self._early(begun).any():
                return begun, True
            found = self._searched(begun, turning=bool(tried))
            tried.append((found, found is begun))
            if not self._leaves_more_than_noise(found):
                return tried[-1]
        return min(tried, key=lambda each: self._misfit(each[0]))

    def _searched(self, best: '_Start', turning: bool) -> '_Start':
        """The best start, with one reversal more after the other."""
        count = int(self._early(best).sum())
        least = self._misfit(best)
        # Ways back are of all scales.
        scales = self._reach * 2.0 ** -np.arange(log2(self._reach / SHORTEST))
        levels = np.concatenate([-scales, scales])
        while len(best.backs) < MOST_REVERSALS:
            places = range(len(best.backs) + 1)
            tried = [
                replace(best, backs=np.insert(best.backs, place, level))
                for place in places
                for level in levels
            ]
            found, left = self._refined(min(tried, key=self._misfit), turning)
            # Each number more has to be worth it (Schwarz), by what is left with it as noise.
            if count * (least - left) <= max(1.0, left) * log(count):
                break
            best, least = found, left
        return best

    def _refined(self, begun: '_Start', turning: bool) -> tuple['_Start', float]:
        """The best start near one, and its misfit; ways back move by their logarithms."""
        # By less than a count of its encoder a motor that is turning is off shows in the wires.
        own = 2 if turning else 0

        def start(numbers: Array) -> _Start:
            moved = np.append(numbers[:own], np.zeros(2 - own))
            # Beyond twice the reach all ways back are clipped to the same one, and below a
            # rounding error none is left: there the misfit is flat, and a search that goes on
            # doubles its step until the exponential overflows or is zero.
            ends = np.log(2.0 * self._reach * EXTREMES[:, None] / np.abs(begun.backs))
            backs = begun.backs * np.exp(np.clip(numbers[own:], *ends))
            return replace(begun, motor=begun.motor + moved, backs=backs)

        begin = np.zeros(own + len(begun.backs))
        options = _around(begin, np.append(FLIGHT[:own], np.full(len(begun.backs), 0.5)))
        found = minimize(lambda n: self._misfit(start(n)), begin, method=SEARCH, options=options)
        return start(found.x), float(found.fun)

    def came(self, start: '_Start') -> tuple[Array, float]:
        """Way (K,) in rad and speed in rad/s of a start, within the motors' reach."""
        here, speed = start.motor
        way = np.append(np.clip(here + start.backs, -self._reach, self._reach), here)
        return way, float(speed)


@dataclass(frozen=True)
class _Start:
    """A motor when its recording begins: angle in rad and speed in rad/s (2,), ways back (K,)."""

    # A way back leads from a reversal, on the way that the motor came, to where it is. Until
    # `turns_until` s the motor is not as its servo would bring it from there.

    motor: Array
    backs: Array = field(default_factory=lambda: np.empty(0))
    turns_until: float = 0.0


def _around(start: Array, size: Array) -> dict[str, Any]:
    """Options of a search (Nelder, Mead) that begins at `start` (n,) and steps by `size` (n,)."""
    simplex = np.vstack([start, start + np.diag(size)])
    return {'maxfev': STEPS * len(start), 'initial_simplex': simplex}


def _is_more_than_noise(squares: Array) -> bool:
    """Whether squares (N,) in noise units are worth a variance of their own (Schwarz)."""
    mean = float(np.mean(squares))
    return mean > 1.0 and len(squares) * (mean - 1.0 - log(mean)) > log(len(squares))


def _is_enough(recording: RigRecording, joint: int, since: float) -> bool:
    command = recording.command
    later = command.values[command.time >= since, joint]
    long = recording.duration - since >= LEAST_DURATION_S
    return bool(long and len(later) and np.ptp(later) >= MOVES_RAD)
