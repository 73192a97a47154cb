"""What the rig had done before the recording began, as far as it still shows.

Friction remembers the last reversals of the motor until greater motion wipes them out (return-point
memory), and of the least one: the tension of a wire that goes back a little falls as the square
root of how far, so that millionths of a rad by which a servo overshot still show. Where the
readings are not those of a rig that came straight from zero, the reversals that explain them best
are taken for its past, and what depends on the past is not judged, if enough is left without it or
if only that part is not as the plant says. Nor is what a motor does that was turning already, until
its servo has forgotten how.
"""

from dataclasses import replace
from math import log, log2

import numpy as np
from scipy.optimize import minimize

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.kernel import run_joints
from endoscope_core.physics.layout import MOTOR_BANDWIDTH, OUTPUTS
from endoscope_core.physics.packing import rest_state
from endoscope_explain.audit.finding import Finding, Severity
from endoscope_explain.audit.standing_still import MOVES_RAD
from endoscope_explain.observe.observation import ANALYSIS_PERIOD, JointObservation, observe
from endoscope_explain.observe.predicted_signals import Flags, packed_rig
from endoscope_explain.recording import Recording
from endoscope_explain.recording.series import Array, Mask

LEAST_S = 2.0
"""Length of what has to be left where the time until the past no longer shows is not judged."""
MOST_REVERSALS = 5
SHORTEST = 1e-6
"""Way back in rad, from where the motor stands, of the smallest reversals that are tried."""
STEPS = 40
"""Of the search that goes on from the best of them, for each reversal."""


def with_state_at_start(
    recording: Recording, plant: PlantDescription, findings: list[Finding]
) -> Recording:
    """Estimate from where the motors had come when a recording began.

    Parameters
    ----------
    recording : Recording
        Audited in all else.
    plant : PlantDescription
        As described.
    findings : list of Finding
        Gets a note where a rig did not come straight from zero.

    Returns
    -------
    Recording
        With `start`, and without the time until it no longer shows by more than the noise, as long
        as enough is left.
    """
    plant = plant.of_joints(recording.joints)
    observations = observe(recording, plant)
    parameters, flags = packed_rig(observations, plant)
    begin = float(recording.command.time[0])
    reach = recording.rig.motors.reach
    starts, left_out = [], []
    for j, observation in enumerate(observations):
        way, unjudged = observation.start, 0.0
        if observation.channels:
            shaft = recording.shaft_position
            seen = observation.start if shaft is None else shaft.values[:1, j]
            past = _Past(observation, parameters[j], flags[j], float(seen[0]), reach)
            way, unjudged, estimated = past.here, begin + past.turns_until, past.estimated()
            if estimated is not None:
                way, end = estimated, begin + past.shows_until
                if _is_enough(recording, j, end) or past.alone_is_unexplained(way):
                    unjudged = end
                findings.append(_finding(observation.joint, begin, end, unjudged, way))
            elif past.turns_until:
                findings.append(_finding(observation.joint, begin, unjudged, unjudged, way))
        starts.append(way)
        left_out.append(unjudged)
    longest = max(map(len, starts))
    # To stay where it has come to adds nothing to a way.
    ways = [np.pad(way, (0, longest - len(way)), mode='edge') for way in starts]
    recording = replace(recording, start=np.stack(ways))
    changed = {}
    for name, series in recording.measured().items():
        early = series.time[:, None] < np.array(left_out)[None]
        shape = (*early.shape, *(1,) * (series.values.ndim - 2))
        early = np.broadcast_to(early.reshape(shape), series.valid.shape)
        changed[name] = series.without(early)
    return recording.with_series(changed)


class _Past:
    """What one joint's past does to its readings, by the plant as described."""

    def __init__(
        self, observation: JointObservation, packed: Array, on: Flags, seen: float, reach: float
    ) -> None:
        self._observation, self._packed, self._on = observation, packed, on
        self._reach = reach
        self._times = times = np.concatenate([c.time for c in observation.channels])
        shaft = np.concatenate(
            [np.full(len(c.time), c.quantity == 'shaft_position') for c in observation.channels]
        )
        asked = float(observation.start[-1])
        ends = [asked, seen, *self._motion()]

        def differ_until(low: list[float], high: list[float], of: Mask | None = None) -> float:
            apart = np.abs(self._left(np.array(high)) - self._left(np.array(low))) >= 1.0
            last = float(times[apart if of is None else apart & of].max(initial=-1.0))
            return last + observation.tick if last >= 0.0 else 0.0

        self.turns_until = differ_until([min(ends)], [max(ends)], shaft)
        # A motor that rested, where it was sent or where it was read, leaves no more than noise.
        first = shaft & (times < self.turns_until)
        rests = [np.array([asked]), np.array([seen])]
        left = [
            float(np.sum(self._left(way)[first] ** 2)) / max(int(first.sum()), 1) for way in rests
        ]
        self.here = rests[int(np.argmin(left))]
        if min(left) <= 1.0:
            self.turns_until = 0.0
        # Whatever the rig did before, its state lies between those of its greatest excursions.
        self.shows_until = differ_until([-reach, min(ends)], [reach, max(ends)])
        self._early = (times >= self.turns_until) & (times < self.shows_until)
        # Samples are means over a period, half of which may come after their time.
        ticks = int(np.ceil((self.shows_until + ANALYSIS_PERIOD) / observation.tick)) + 2
        self._cut = replace(observation, inputs=observation.inputs[:, :ticks])

    def _motion(self) -> list[float]:
        """Where the motor was at first, and where its speed led while a servo forgets it."""
        shaft = next(
            (c for c in self._observation.channels if c.quantity == 'shaft_position'), None
        )
        if shaft is None or len(shaft.time) < 2:
            return []
        first, second = shaft.value[:2].tolist()
        speed = (second - first) / float(shaft.time[1] - shaft.time[0])
        return [first, first + speed / float(self._packed[MOTOR_BANDWIDTH])]

    def _left(self, way: Array, observation: JointObservation | None = None) -> Array:
        """Residuals (size,) in noise units where the motor came by a way (K,)."""
        seen = observation or self._observation
        packed, on = self._packed[None], self._on[None]
        out = np.empty((1, seen.inputs.shape[1], OUTPUTS))
        at_rest = rest_state(packed, on, seen.tick, way[None])
        run_joints(*at_rest, packed, on, seen.inputs, False, seen.tick, out)
        ends = np.full((1, self._observation.inputs.shape[1] - out.shape[1], OUTPUTS), np.nan)
        outputs = np.concatenate([out, ends], axis=1)[0]
        return np.concatenate(
            [(c.predicted(outputs) - c.value) / c.noise for c in self._observation.channels]
        )

    def alone_is_unexplained(self, way: Array) -> bool:
        """Whether the readings differ from the plant's while the past shows, and not after it."""
        left = self._left(way) ** 2
        early, later = left[self._early], left[self._times >= self.shows_until]
        if not len(later):
            return False
        return _is_more_than_noise(early) and not _is_more_than_noise(later)

    def _misfit(self, way: Array) -> float:
        return float(np.sum(self._left(way, self._cut)[self._early] ** 2))

    def estimated(self) -> Array | None:
        """Way (K,) that the motor came; None where it may have come straight."""
        count = int(self._early.sum())
        if not count:
            return None
        here, reach = self.here[0], self._reach

        def way(backs: Array) -> Array:
            return np.append(np.clip(here + backs, -reach, reach), here)

        def misfit(backs: Array) -> float:
            return self._misfit(way(backs))

        # Way back from each reversal to where the motor stands: on all scales, so by its logarithm.
        scales = reach * 2.0 ** -np.arange(log2(reach / SHORTEST))
        levels = np.concatenate([-scales, scales])
        best, least = np.empty(0), misfit(np.empty(0))
        while len(best) < MOST_REVERSALS:
            places = range(len(best) + 1)
            tried = [np.insert(best, place, level) for place in places for level in levels]
            begin = min(tried, key=misfit)

            def scaled(logarithms: Array, begin: Array = begin) -> float:
                return misfit(begin * np.exp(logarithms))

            simplex = np.vstack([np.zeros(len(begin)), 0.5 * np.eye(len(begin))])
            options = {'maxfev': STEPS * len(begin), 'initial_simplex': simplex}
            found = minimize(scaled, simplex[0], method='Nelder-Mead', options=options)
            # Each number more has to be worth it (Schwarz), by what is left with it as noise.
            noise = max(1.0, found.fun / count)
            if least - found.fun <= noise * log(count):
                break
            best, least = begin * np.exp(found.x), found.fun
        return way(best) if len(best) else None


def _is_more_than_noise(squares: Array) -> bool:
    """Whether squares (N,) in noise units are worth a variance of their own (Schwarz)."""
    mean = float(np.mean(squares))
    return mean > 1.0 and len(squares) * (mean - 1.0 - log(mean)) > log(len(squares))


def _is_enough(recording: Recording, joint: int, since: float) -> bool:
    command = recording.command
    later = command.values[command.time >= since, joint]
    long = recording.duration - since >= LEAST_S
    return bool(long and len(later) and np.ptp(later) >= MOVES_RAD)


def _finding(joint: str, begin: float, end: float, unjudged: float, way: Array) -> Finding:
    if unjudged < end:
        remedy = 'the state at the start is estimated, and all is judged from it'
    else:
        remedy = f'what is before {end:.2f} s is not judged'
    return Finding(
        'earlier_motion',
        Severity.NOTE,
        joint,
        'recording',
        (joint,),
        ((begin, end),),
        f'{joint} had moved before the recording began, which shows until {end:.2f} s',
        remedy,
        evidence={f'reversal_{k}_rad': float(angle) for k, angle in enumerate(way[:-1], start=1)},
    )
