"""A family of functions of one state: a Gaussian process on the states that a recording visits.

Seven Karhunen-Loeve coefficients of a Matern-5/2 process whose length is a quarter of the range
(Rasmussen, Williams, Gaussian Processes for Machine Learning, MIT Press 2006, ch. 4.2), with a
normal prior each: the evidence itself then pays for a flexible function.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from endoscope_core.physics.functions.places import NODES, RELAXING, Place, Shape
from endoscope_core.physics.layout import (
    IN_COMMAND,
    IN_OTHER_JOINT,
    JOINT_RADIUS,
    OUT_JOINT,
    OUT_MOTOR,
    OUT_MOTOR_SPEED,
    OUT_TENSION_A,
    OUT_TENSION_B,
    PULLEY_RADIUS,
)
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.recording import Array

COEFFICIENTS = 7
LENGTH = 0.25
"""Of the process with so many coefficients, as a share of the range."""
LEAST_PART = 1e-9
"""Share of the largest eigenvalue below which one is rounding."""
_IMAGES = 4
"""Periods on either side that count for the process of a period."""
LEAST_RANGE = 1e-6
"""Share of a place's own range below which a state has not moved."""


@dataclass(frozen=True)
class Family:
    """Functions at a place."""

    place: Place
    # Range of the argument; one period where functions repeat themselves.
    low: float
    high: float
    # (NODES, K), values at the nodes for coefficients that are normal, each with a variance of one.
    basis: Array
    # Of the periods that functions may have that repeat themselves, or of an argument's lag.
    band: tuple[float, float] | None = None
    multiplies: bool = False  # whether they multiply what other functions add there; see `TermSpec`
    lag: float | None = None  # time constant in s of an argument that lags, which a fit may move

    @property
    def largest(self) -> float:
        """Largest absolute value."""
        return self.place.largest_of(self.multiplies)

    @property
    def repeats(self) -> bool:
        """Whether the range is a period, which a fit may move."""
        return self.place.shape is Shape.PERIODIC

    @property
    def nodes(self) -> Array:
        """The argument at the nodes (NODES,)."""
        return np.linspace(self.low, self.high, NODES)

    def values(self, coefficients: Array) -> Array:
        """Values (NODES,) at the nodes, within what the place allows."""
        return self.within(self.basis @ coefficients)

    def within(self, values: Array) -> Array:
        """Values (NODES,) cut to what the place allows."""
        if self.place.never_negative and not self.multiplies:
            values = np.maximum(values, 0.0)
        return np.clip(values, -self.largest, self.largest)

    @property
    def size(self) -> float:
        """Rms over the nodes of a function drawn from the prior."""
        return float(np.sqrt(np.mean(np.sum(self.basis**2, axis=1))))

    def finer(self, count: int, visited: tuple[float, float] | None = None) -> 'Family':
        """Functions of the same place and size with more coefficients, over another range."""
        found = family_at(self.place, visited or (self.low, self.high), count, self.band)
        assert found is not None
        found = replace(found, multiplies=self.multiplies, lag=self.lag)
        return found.scaled(self.size / found.size)

    def details(self, generator: np.random.Generator) -> Array:
        """A function (NODES,) that varies faster than these do, drawn as they are."""
        finer = self.finer(min(2 * self.basis.shape[1], NODES)).basis
        drawn = finer @ generator.normal(size=finer.shape[1])
        span, _ = np.linalg.qr(self.basis)
        return np.asarray(drawn - span @ (span.T @ drawn))

    def scaled(self, amplitude: float) -> 'Family':
        """The same functions, larger by a factor."""
        return replace(self, basis=amplitude * self.basis)


def family_at(
    place: Place,
    visited: tuple[float, float],
    count: int = COEFFICIENTS,
    band: tuple[float, float] | None = None,
) -> Family | None:
    """Functions of unit variance over the visited range; None where the state did not move."""
    # The range is one period where functions repeat themselves. The more coefficients there are,
    # the shorter the length over which the functions vary.
    low, high = visited
    if place.shape in (Shape.ODD, Shape.EVEN):
        high = max(abs(low), abs(high))
        low = -high
    if high - low <= LEAST_RANGE * (place.argument.high - place.argument.low):
        return None
    side, length = np.linspace(0.0, 1.0, NODES), LENGTH * COEFFICIENTS / count
    if place.shape is Shape.PERIODIC:
        return Family(place, low, high, _periodic(side, length, count), band)
    covariance = _matern((side[:, None] - side[None, :]) / length)
    if place.shape in (Shape.ODD, Shape.EVEN):
        mirrored = _matern((side[:, None] - (1.0 - side[None, :])) / length)
        covariance += mirrored if place.shape is Shape.EVEN else -mirrored
    sizes, vectors = np.linalg.eigh(covariance)
    largest = [k for k in np.argsort(sizes)[::-1][:count] if sizes[k] > LEAST_PART * sizes.max()]
    # What an eigenvector's sign is depends on the library; a drag grows with the first of them.
    signs = np.where(vectors[:, largest].sum(axis=0) < 0.0, -1.0, 1.0)
    basis = vectors[:, largest] * signs * np.sqrt(sizes[largest])
    return Family(place, low, high, basis, band)


def _periodic(side: Array, length: float, count: int) -> Array:
    """Harmonics (NODES, K) in pairs, each as large as the process of a period has it."""
    # Its mean is left out: it is the rest angle, or taken away.
    lags = side[:-1]
    images = range(-_IMAGES, _IMAGES + 1)
    covariance = np.sum([_matern((lags + image) / length) for image in images], axis=0)
    spectrum = np.fft.rfft(covariance).real / len(lags)
    columns = []
    for k in range(1, min(count // 2, len(spectrum) - 2) + 1):
        size = np.sqrt(2.0 * max(spectrum[k], 0.0))
        columns += [size * np.cos(2.0 * np.pi * k * side), size * np.sin(2.0 * np.pi * k * side)]
    return np.stack(columns, axis=1)


def visited_states(
    observation: JointObservation, parameters: Array, outputs: Array
) -> dict[tuple[str, str], Array]:
    """States along a simulation (N, OUTPUTS), by the symbol and unit of a place's argument."""
    # The ends of the values are those of the range; time, the shaft's angle, and what arguments
    # that lag follow, are on ticks (N, ...).
    angle, shaft = outputs[:, OUT_JOINT], outputs[:, OUT_MOTOR]
    speed = np.gradient(angle, observation.tick)
    shaft_speed = outputs[:, OUT_MOTOR_SPEED]
    slid = 0.5 * np.abs(parameters[PULLEY_RADIUS] * shaft_speed + parameters[JOINT_RADIUS] * speed)
    tensions = outputs[:, [OUT_TENSION_A, OUT_TENSION_B]]
    command = observation.inputs[0, :, IN_COMMAND]
    return {
        ('t', 's'): np.linspace(0.0, observation.duration, len(outputs)),
        ('v', 'm/s'): np.array([0.0, np.quantile(slid, 0.99)]),
        ('d', 'm'): np.array([0.0, observation.tick * float(np.sum(slid))]),
        ('T', 'N'): tensions,
        ('D', 'N'): tensions[:, 0] - tensions[:, 1],
        ('q', 'rad'): angle,
        ('q_other', 'rad'): observation.inputs[0, :, IN_OTHER_JOINT],
        ('w', 'rad/s'): np.quantile(np.concatenate([speed, shaft_speed]), [0.005, 0.995]),
        ('m', 'rad'): shaft,
        ('u', 'rad'): command,
        ('z', 'rad'): angle,
        ('F', 'N'): tensions - tensions[0],
        ('y', 'm/s'): slid,
        ('e', 'rad'): shaft - command,
        ('s', 'm'): parameters[PULLEY_RADIUS] * np.concatenate([shaft, -shaft]),
    }


def visited_range(
    place: Place, states: dict[tuple[str, str], Array], tick: float, lag: float | None = None
) -> tuple[float, float]:
    """Range of a place's argument, which may lag by `lag` s, along a simulation."""
    state = states[place.argument.symbol, place.argument.unit]
    if lag is not None:
        kept = np.exp(-tick / lag)
        start = kept * state[:1]
        late, _ = lfilter([1.0 - kept], [1.0, -kept], state, axis=0, zi=start)
        state = state - late if place.argument is RELAXING else late
    return float(np.min(state)), float(np.max(state))


def _matern(distance: Array) -> Array:
    scaled = np.sqrt(5.0) * np.abs(distance)
    return np.asarray((1.0 + scaled + scaled**2 / 3.0) * np.exp(-scaled))
