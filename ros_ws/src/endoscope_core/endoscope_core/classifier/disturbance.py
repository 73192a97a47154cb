"""What load cells, cables and people do to tensions: readings of known tubes, and of none."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Single = NDArray[np.float32]
Generator = np.random.Generator

READING_PERIODS = (1, 2, 5, 10)
"""In ms."""
NOISE, ZERO, GAIN = 0.02, 0.02, 0.01
"""Rms noise of a reading in N, and deviations of zeros in N and of gains: of good cells."""
_POOR = 0.3
_POORER = 5.0


def read(
    tension: Single, generator: Generator, period: int = 1, zero: float = 0.0, gain: float = 0.0
) -> Single:
    """Readings of noise-free tensions (R, N, 4) in N at 1 kHz, one each `period` ms.

    `zero` and `gain` are standard deviations of the cells' zero errors in N and relative gain
    errors; readings are joined by straight lines at 1 kHz.
    """
    recordings, samples, wires = tension.shape
    cells = (recordings, 1, wires)
    shift = zero * generator.standard_normal(cells, np.float32)
    factor = 1.0 + gain * generator.standard_normal(cells, np.float32)
    begin = -int(generator.integers(period))
    stamps = np.arange(begin, samples + period, period)
    found = tension[:, np.clip(stamps, 0, samples - 1)] * factor + shift
    found += np.float32(NOISE) * generator.standard_normal(found.shape, np.float32)
    if period == 1:
        return found[:, :samples]
    left, rest = np.divmod(np.arange(samples) - begin, period)
    share = (rest / period).astype(np.float32)[:, None]
    return found[:, left] * (1.0 - share) + found[:, left + 1] * share


def read_of_all_kinds(tension: Single, generator: Generator) -> Single:
    """Readings (R, N, 4) as cells of every quality and rate give them: a period for each part.

    Three of ten recordings are of poorer cells, with five times the error of zero and gain.
    """
    found = np.empty_like(tension)
    parts = np.array_split(np.arange(len(tension)), len(READING_PERIODS))
    for part, period in zip(parts, READING_PERIODS, strict=True):
        poor = generator.random(len(part)) < _POOR
        for rows, worse in ((part[~poor], 1.0), (part[poor], _POORER)):
            found[rows] = read(tension[rows], generator, period, worse * ZERO, worse * GAIN)
    return found


def exchanged_in_a_joint(tension: Single, generator: Generator) -> Single:
    """The cables of both cells of a joint are plugged in the wrong way round."""
    first = 2 * int(generator.integers(tension.shape[1] // 2))
    order = np.arange(tension.shape[1])
    order[[first, first + 1]] = first + 1, first
    return tension[:, order]


def exchanged_across_joints(tension: Single, generator: Generator) -> Single:
    """One cell of each joint is plugged in where that of the other belongs."""
    x, y = int(generator.integers(2)), 2 + int(generator.integers(2))
    order = np.arange(tension.shape[1])
    order[[x, y]] = y, x
    return tension[:, order]


def unplugged(tension: Single, generator: Generator) -> Single:
    """One cell shows its zero."""
    found, wire = tension.copy(), _wire(tension, generator)
    found[:, wire] = 0.0
    return found


def stuck(tension: Single, generator: Generator) -> Single:
    """One cell stays at what it once showed."""
    found, wire = tension.copy(), _wire(tension, generator)
    found[:, wire] = found[int(generator.integers(len(found))), wire]
    return found


def clipped(tension: Single, generator: Generator) -> Single:
    """One cell clips at 60 to 90 % of what its wire reaches."""
    found, wire = tension.copy(), _wire(tension, generator)
    limit = generator.uniform(0.6, 0.9) * np.max(found[:, wire])
    found[:, wire] = np.minimum(found[:, wire], limit)
    return found


def drifting(tension: Single, generator: Generator, drift: float) -> Single:
    """One cell drifts evenly by so many N over the recording, either way."""
    found, wire = tension.copy(), _wire(tension, generator)
    sign = generator.choice((-1.0, 1.0))
    found[:, wire] += np.linspace(0.0, sign * drift, len(found), dtype=np.float32)
    return found


def slow(tension: Single, generator: Generator) -> Single:
    """One cell answers with a time constant of 0.15 to 0.5 s."""
    found, wire = tension.copy(), _wire(tension, generator)
    lag = generator.uniform(150.0, 500.0)
    time = np.arange(min(len(found), int(5.0 * lag)))
    kernel = np.exp(-time / lag)
    padded = np.concatenate([np.full(len(time) - 1, found[0, wire]), found[:, wire]])
    spectrum = np.fft.rfft(padded, 2 * len(padded)) * np.fft.rfft(
        kernel / kernel.sum(), 2 * len(padded)
    )
    whole = np.fft.irfft(spectrum, 2 * len(padded))
    found[:, wire] = whole[len(time) - 1 : len(time) - 1 + len(found)]
    return found


def slack(tension: Single, generator: Generator) -> Single:
    """A joint without pretension: both its wires are looser by 2 to 6 N."""
    found = tension.copy()
    first = 2 * int(generator.integers(tension.shape[1] // 2))
    looser = np.float32(generator.uniform(2.0, 6.0))
    found[:, first : first + 2] = np.maximum(found[:, first : first + 2] - looser, 0.0)
    return found


STRANGE: dict[str, Callable[[Single, Generator], Single]] = {
    'exchanged in a joint': exchanged_in_a_joint,
    'unplugged': unplugged,
    'stuck': stuck,
    'clipped at 60 to 90 %': clipped,
    'slow': slow,
    'slack': slack,
}
"""What makes tensions (N, 4) in N those of no tube. Cells exchanged across joints are none of it:
the joints of an instrument are made alike, and the size hardly changes. Nor is drift, which a loop
that does not close shows by itself."""
SUBTLE = (clipped, slow)
"""Of those, what leaves most of a recording as it was; a training needs it more often."""


def _wire(tension: Single, generator: Generator) -> int:
    return int(generator.integers(tension.shape[1]))
