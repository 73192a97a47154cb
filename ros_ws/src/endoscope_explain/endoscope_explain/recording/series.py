"""A recording as analysis sees it: one time series for each measured quantity, by joint."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_bags.recording import Recording as Bag
from endoscope_core.rig import Rig, shipped_rig

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

COMMAND = 'motor/servo_jp'
SETPOINT = 'motor/setpoint_js'
MOTOR = 'motor/measured_js'
WIRES = 'wires/measured_js'
BENDING = 'slave/measured_js'
DESIRED = 'slave/servo_jp'
INPUTS = (SETPOINT, COMMAND, DESIRED)
"""The nearest to the shafts first.

A setpoint says what the motor driver made of commands: which it obeyed, how it bounded them, and
the pose that it held once they had ended.
"""


@dataclass(frozen=True)
class Series:
    """Samples of one quantity.

    Attributes
    ----------
    topic : str
        Topic without namespace that it comes from.
    time : array (N,)
        Header stamps in s from the recording's first stamp.
    values : array (N, J) or (N, J, 2)
        One column for each joint; tensions have two for each, positive and negative wire.
    valid : array like values, of bool
        False where a sample must not be judged: absent, frozen, clipped or wrong.
    received : array (N,) or None
        When each sample was received, by the recorder's clock, in s from the recording's first
        stamp.
    lost : array (N,) of int or None
        Messages that were published and not recorded directly before each sample; None where the
        recorder does not tell.
    """

    topic: str
    time: Array
    values: Array
    valid: Mask
    received: Array | None = None
    lost: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        if len(self.time) != len(self.values) or self.valid.shape != self.values.shape:
            raise ValueError(f'{self.topic}: time, values and valid differ in length')

    @staticmethod
    def of(topic: str, time: Array, values: Array, received: Array | None = None) -> 'Series':
        """All samples valid where they are finite."""
        return Series(topic, time, values, np.isfinite(values), received)

    def taken(self, index: NDArray[np.intp] | Mask) -> 'Series':
        """Return the samples of an index array, in its order."""
        return replace(
            self,
            time=self.time[index],
            values=self.values[index],
            valid=self.valid[index],
            received=None if self.received is None else self.received[index],
            lost=None if self.lost is None else self.lost[index],
        )

    def without(self, wrong: Mask) -> 'Series':
        """Return the same samples, with those that are `wrong` no longer valid."""
        return replace(self, valid=self.valid & ~wrong)


@dataclass(frozen=True)
class Recording:
    """What was commanded and measured.

    Attributes
    ----------
    name : str
        What to call it in messages.
    origin : float
        First stamp of all, in s of the recording's clock.
    joints : tuple of str
        Joints in the order of every series' columns.
    command : Series
        Motor shaft command in rad, each in force from its stamp until the next one.
    tension : Series or None
        Load cells in N, values (N, J, 2): positive, negative wire; None on a rig without them.
    bending : Series
        Bending angle in rad from the tracker.
    shaft_position, shaft_velocity, shaft_effort : Series or None
        Motor shaft in rad, rad/s, N m; None where not recorded.
    notes : tuple of str
        What is missing or was taken from elsewhere, in words.
    start : array (J, K) or None
        Shaft angles in rad to which each motor had gone, one after the other, when the recording
        began; the first command alone where None.
    start_speed : array (J,) or None
        Speed of each motor then, rad/s; they stood where None.
    rig : Rig
        Gear, limits and time-outs of what was recorded.
    """

    name: str
    origin: float
    joints: tuple[str, ...]
    command: Series
    tension: Series | None
    bending: Series
    shaft_position: Series | None = None
    shaft_velocity: Series | None = None
    shaft_effort: Series | None = None
    notes: tuple[str, ...] = field(default=())
    start: Array | None = None
    start_speed: Array | None = None
    rig: Rig = field(default_factory=shipped_rig)

    def measured(self) -> dict[str, Series]:
        """Return the recorded measured series by their name in this class."""
        names = ('shaft_position', 'shaft_velocity', 'shaft_effort', 'tension', 'bending')
        return {name: s for name in names if (s := getattr(self, name)) is not None}

    def with_series(self, changed: Mapping[str, Series]) -> 'Recording':
        """Return the same recording with some series, by name, replaced."""
        fields: dict[str, Any] = dict(changed)
        return replace(self, **fields)

    @property
    def gear(self) -> float:
        """Angle of a motor's shaft for one radian of desired bending."""
        return self.rig.joints.gear

    @property
    def duration(self) -> float:
        """Seconds from the first stamp to the last one of any series."""
        last = [self.command.time[-1], *(s.time[-1] for s in self.measured().values())]
        return float(max(last))


def input_topic(bag: Bag, namespace: str | None = None) -> str:
    """The plant's input, the nearest to the shafts that was recorded; empty where none was."""
    return next((topic for topic in INPUTS if bag.has(topic, namespace)), '')
