"""Load cells that clip."""

import numpy as np

from endoscope_core.physics.effect import Symptom
from endoscope_core.physics.effects import showing
from endoscope_explain.audit.finding import Finding, Severity
from endoscope_explain.explanation import Estimate
from endoscope_explain.recording.series import Array, Mask


def clipped(values: Array, noise: float, resolution: float) -> tuple[Mask, float] | None:
    """Find readings (N,) at the limit of a clipped cell, and the limit in N; None if none clips."""
    top = float(values.max())
    step = resolution if resolution > 0 else 1e-9 * max(1.0, abs(top))
    # Readings of an unclipped cell thin out towards their maximum; those of a clipped one pile up
    # there. The pile is looked for in steps of the cell's resolution.
    at_limit = values >= top - 0.5 * step
    pile = int(at_limit.sum())
    if pile < 20:
        return None
    # How many readings fall into the steps just below, where the same signal is not clipped.
    width = max(10 * step, noise)
    below = int(((values < top - 0.5 * step) & (values >= top - width)).sum())
    usual_in_a_step = below * step / width
    if pile < 10 * usual_in_a_step + 20:
        return None
    return at_limit, top


def saturation_finding(
    joint: str,
    signal: str,
    time: Array,
    at_limit: Mask,
    limit: float,
    resolution: float,
    wire: int,
) -> Finding:
    """Describe the `load_cell_saturation` of one wire (0: positive, 1: negative)."""
    edges = np.flatnonzero(np.diff(np.r_[False, at_limit, False].astype(int)))
    # Noise dips below the limit: passages closer than 0.1 s are one.
    spans: list[tuple[float, float]] = []
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        begin, end = float(time[a]), float(time[b - 1])
        if spans and begin - spans[-1][1] < 0.1:
            spans[-1] = (spans[-1][0], end)
        else:
            spans.append((begin, end))
    return Finding(
        showing(Symptom.CLIPPED_TENSION).id,
        Severity.FAULT,
        joint,
        'sensing',
        (signal,),
        tuple(spans),
        f'{signal} clips at {limit:.3f} N in {int(at_limit.sum())} samples',
        'clipped samples are not judged',
        parameters={
            'limit_n': Estimate(limit, limit - resolution, limit + resolution, 'N'),
            'wire': Estimate(float(wire), float(wire), float(wire), '-'),
        },
        evidence={'count': float(at_limit.sum())},
    )
