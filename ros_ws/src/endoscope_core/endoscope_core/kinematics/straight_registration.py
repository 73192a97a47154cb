"""Where the instrument's base is in the tracker's frame, from readings of the straight instrument.

The tracker reports the sensor in the tip in a frame of its own, which has nothing to do with the
instrument.  With the instrument straight, its sensor points along the base's z axis; what the
sensor turned since then, seen in the straight sensor's frame, is the bending:
``bending rotation = straight^-1 * now``.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from endoscope_core.errors import EndoscopeError

Array = NDArray[np.float64]


class RegistrationError(EndoscopeError, ValueError):
    """The readings do not show a straight instrument at rest; the message says why."""


@dataclass(frozen=True)
class StillnessLimits:
    """How still the tip must be while it is registered, in rad and m."""

    readings: int = 30  # fewest readings
    # Largest root mean square deviation of orientation in rad and of position in m.
    angle: float = 0.015
    distance: float = 0.001
    # Largest difference between the means of the first and of the second half.
    drift_angle: float = 0.005
    drift_distance: float = 0.0005


@dataclass(frozen=True)
class StraightRegistration:
    """Pose (m) of the sensor in the tracker's frame while the instrument was straight."""

    position: tuple[float, ...]  # in m, shape (3,)
    orientation: tuple[float, ...]  # unit quaternion x, y, z, w, shape (4,)

    def in_base(
        self, position: ArrayLike, orientation: ArrayLike, *, roll: float, length: float
    ) -> tuple[Array, Array]:
        """Position (3,) in m and orientation (4,) of the tip in the frame of the instrument's base.

        `position` (3,) in m and `orientation` (4,) x, y, z, w are the sensor's in the tracker's
        frame, `roll` in rad its angle about z as mounted, `length` in m where the tip of the
        straight instrument is.
        """
        mounted = Rotation.from_rotvec((0.0, 0.0, roll))
        to_base = mounted * Rotation.from_quat(self.orientation).inv()
        moved = np.asarray(position, dtype=float) - np.asarray(self.position)
        turned = to_base * Rotation.from_quat(orientation) * mounted.inv()
        return to_base.apply(moved) + np.array([0.0, 0.0, length]), turned.as_quat()


def register_straight(
    positions: Sequence[ArrayLike],
    orientations: Sequence[ArrayLike],
    limits: StillnessLimits | None = None,
) -> StraightRegistration:
    """Average N positions (3,) in m and orientations (4,) x, y, z, w of the straight instrument.

    RegistrationError if there are too few readings, or the tip was not still.
    """
    limits = limits or StillnessLimits()
    count = len(positions)
    if count < limits.readings:
        raise RegistrationError(
            f'{count} readings of the tip in the last second, {limits.readings} are needed: '
            'keep the sensor in the measurement volume and ask again'
        )
    place = np.asarray(positions, dtype=float)
    turn = Rotation.from_quat(orientations)
    position, orientation = place.mean(axis=0), turn.mean()
    half = count // 2
    checks = (
        ('turned by', _rms((orientation.inv() * turn).magnitude()), limits.angle, 'rad'),
        ('moved by', _rms(np.linalg.norm(place - position, axis=1)), limits.distance, 'm'),
        (
            'kept turning, by',
            float((turn[:half].mean().inv() * turn[half:].mean()).magnitude()),
            limits.drift_angle,
            'rad',
        ),
        (
            'kept moving, by',
            float(np.linalg.norm(place[:half].mean(axis=0) - place[half:].mean(axis=0))),
            limits.drift_distance,
            'm',
        ),
    )
    for what, found, allowed, unit in checks:
        if found > allowed:
            raise RegistrationError(
                f'the tip {what} {found:.2g} {unit} within a second, {allowed:.2g} {unit} is '
                'allowed: let the straight instrument rest and ask again'
            )
    return StraightRegistration(
        tuple(position.tolist()), tuple(orientation.as_quat(canonical=True).tolist())
    )


def _rms(values: ArrayLike) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
