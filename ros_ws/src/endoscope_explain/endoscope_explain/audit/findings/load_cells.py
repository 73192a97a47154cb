"""Load cells that read no further than a limit, or that were not recorded."""

import numpy as np

from endoscope_core.physics.effect import Symptom
from endoscope_core.physics.effects import showing
from endoscope_explain.audit.examined import Examined, runs
from endoscope_explain.audit.finding import FindingKind, Severity
from endoscope_explain.explanation import Estimate
from endoscope_explain.recording import WIRES, Array, Mask

ABSENT = FindingKind(
    'no_load_cells',
    Severity.NOTE,
    '{signals} was not recorded: {beside} what acts in the sheaths from what acts in the joint, '
    'and pretension from friction',
    'an effect of one of them may be named for one of the other, and no load cell is judged',
)
SATURATED = FindingKind(
    showing(Symptom.CLIPPED_TENSION).id,
    Severity.FAULT,
    '{signals} clips at {limit:.3f} N in {count:.0f} samples',
    'clipped samples are not judged',
    'sensing',
)


def find(seen: Examined) -> Examined:
    """Leave out what is clipped."""
    recording, series, sensors = seen.recording, seen.recording.tension, seen.plant.sensors
    if series is None:
        torque = recording.shaft_effort is not None
        alone = 'the torque of the motor alone' if torque else 'nothing'
        beside = f'{alone} distinguishes'
        return seen.found(ABSENT.found(recording, (WIRES,), beside=beside))
    noise, step = sensors.load_cell_noise, sensors.load_cell_resolution
    flat = series.values.reshape(len(series.time), -1)
    piles = np.stack([_at_limit(values, noise, step) for values in flat.T], axis=1)
    clipped = piles & series.valid.reshape(flat.shape)
    found = []
    for place, mask in enumerate(clipped.T):
        if mask.any():
            limit, wire = float(flat[:, place].max()), float(place % 2)
            saturated = SATURATED.found(
                recording,
                [('tension', place)],
                _passages(series.time, mask),
                limit=limit,
                parameters={
                    'limit_n': Estimate(limit, limit - step, limit + step, 'N'),
                    'wire': Estimate(wire, wire, wire, '-'),
                },
                evidence={'count': float(mask.sum())},
            )
            found.append(saturated)
    tension = series.without(clipped.reshape(series.valid.shape))
    return seen.found(*found, recording=recording.with_series({'tension': tension}))


def _at_limit(values: Array, noise: float, resolution: float) -> Mask:
    """Readings (N,) in N at the limit of a clipped cell; none if it is not clipped."""
    none, top = np.zeros(len(values), bool), float(values.max())
    step = resolution if resolution > 0 else 1e-9 * max(1.0, abs(top))
    # Readings of an unclipped cell thin out towards their maximum; those of a clipped one pile up
    # there. The pile is looked for in steps of the cell's resolution.
    at_limit = values >= top - 0.5 * step
    pile = int(at_limit.sum())
    if pile < 20:
        return none
    # How many readings fall into the steps just below, where the same signal is not clipped.
    width = max(10 * step, noise)
    below = int((~at_limit & (values >= top - width)).sum())
    usual_in_a_step = below * step / width
    return none if pile < 10 * usual_in_a_step + 20 else at_limit


def _passages(time: Array, clipped: Mask) -> list[tuple[float, float]]:
    """From when to when a cell clips, by its stamps (N,) in s."""
    # Noise dips below the limit: passages closer than 0.1 s are one.
    found: list[tuple[float, float]] = []
    for a, b in runs(clipped):
        near = found and time[a] - found[-1][1] < 0.1
        begin = found.pop()[0] if near else float(time[a])
        found.append((begin, float(time[b])))
    return found
