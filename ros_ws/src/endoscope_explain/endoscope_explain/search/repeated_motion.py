"""Whether a joint moves the same way twice: without that, time and state cannot be told apart."""

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.layout import IN_COMMAND
from endoscope_explain.observe.observation import TICK, JointObservation

Array = NDArray[np.float64]


EVERY_S = 0.02
"""Time between the moments compared."""
APART_S = 1.0
APART_SHARE = 0.05
"""Of the recording: a slow ramp has left the neighbourhood of an angle by then."""
NEAR_ANGLE = 0.02
NEAR_SPEED = 0.10
LEAST_SHARE = 0.10
"""Share of the recording that must have been seen before; a sine of 9 s has 0.3."""


def motion_repeats(observation: JointObservation) -> bool:
    """Whether enough of a joint's commanded motion has been commanded before.

    A smooth force that depends on time explains any single pass through the workspace, and nothing
    of the next one.
    """
    command = observation.inputs[0, :, IN_COMMAND]
    return share_seen_before(command, observation.tick) >= LEAST_SHARE


def share_seen_before(command: Array, tick: float = TICK) -> float:
    """Share of the moments at which angle and speed were near what they had been before.

    `command` (N,): in rad. Near is within `NEAR_ANGLE` of its range and `NEAR_SPEED` of its largest
        speed; before is at least `APART_S` and `APART_SHARE` of the recording earlier.
    `tick`: time between two of its values in s.
    """
    every = max(1, round(EVERY_S / tick))
    angle = command[::every]
    speed = np.gradient(angle) if len(angle) > 1 else np.zeros_like(angle)
    near_angle = NEAR_ANGLE * np.ptp(angle)
    near_speed = NEAR_SPEED * np.max(np.abs(speed), initial=0.0)
    apart = max(round(APART_S / (every * tick)), round(APART_SHARE * len(angle)))
    seen = [
        bool(
            np.any(
                (np.abs(angle[: i - apart] - angle[i]) <= near_angle)
                & (np.abs(speed[: i - apart] - speed[i]) <= near_speed)
            )
        )
        for i in range(apart + 1, len(angle))
    ]
    return sum(seen) / max(len(angle), 1)
