"""The motions that can be asked for by name."""

from __future__ import annotations

import difflib
from collections.abc import Callable

from endoscope_core.errors import EndoscopeError
from endoscope_core.signals.calibration_sinusoid import calibration_sinusoid
from endoscope_core.signals.commissioning import commissioning_motion
from endoscope_core.signals.signal import Motion, Signal
from endoscope_core.signals.tracking_signals import non_periodic_signal, periodic_signal


class UnknownMotionError(EndoscopeError, ValueError):
    """A motion that is not in the catalogue."""


def both_joints(signal: Signal) -> Motion:
    """The same signal for `bend_x` and `bend_y`."""
    return Motion(signal.name, {'bend_x': signal, 'bend_y': signal})


MOTIONS: dict[str, Callable[[], Motion]] = {
    'calibration': lambda: both_joints(calibration_sinusoid()),
    'periodic': lambda: both_joints(periodic_signal()),
    'non_periodic': lambda: both_joints(non_periodic_signal()),
    'commissioning': commissioning_motion,
}
"""What makes each motion, by its name."""


def motion_by_name(name: str) -> Motion:
    """Motion of both joints called `name`.

    Raises
    ------
    UnknownMotionError
        If there is none of that name; the message names the nearest.
    """
    if name not in MOTIONS:
        near = difflib.get_close_matches(name, MOTIONS, n=1, cutoff=0.0)
        raise UnknownMotionError(
            f'unknown motion {name!r}, nearest is {near[0]!r} (known: {", ".join(MOTIONS)})'
        )
    return MOTIONS[name]()
