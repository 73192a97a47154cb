"""A gamepad or joystick of the topic ``joy`` as a handle, by the parameters of teleop_twist_joy."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from endoscope_console.teleop.frames import InputFrame, MalformedFrameError, Source
from endoscope_core.errors import EndoscopeError, nearest

DEFAULTS: Mapping[str, bool | int | float] = {
    'require_enable_button': True,
    'enable_button': 5,
    'enable_turbo_button': 4,
    'axis_angular.bend_x': 0,
    'axis_angular.bend_y': 1,
    'scale_angular.bend_x': 0.5,
    'scale_angular.bend_y': 0.5,
    'scale_angular_turbo.bend_x': 1.0,
    'scale_angular_turbo.bend_y': 1.0,
    'pause_button': 8,
}
"""Names and defaults: numbers of buttons and axes, -1 for none; rad/s at full deflection."""

_JOINTS = ('bend_x', 'bend_y')
_MAY_BE_NONE = ('enable_turbo_button', 'pause_button')


class JoyMapping:
    """Turns axes and buttons into the frames of an operator.

    The enable button is the dead-man, as it is in teleop_twist_joy
    (https://github.com/ros2/teleop_twist_joy); the turbo button is another one, not a modifier.
    `parameters` are what differs from `DEFAULTS`; EndoscopeError where one cannot be used.
    """

    def __init__(self, parameters: Mapping[str, bool | int | float] | None = None) -> None:
        of = dict(DEFAULTS)
        for name, value in (parameters or {}).items():
            of[name] = _checked(name, value)
        if not of['require_enable_button']:
            raise EndoscopeError(
                'require_enable_button: false is refused: nothing moves without a held dead-man'
            )
        if of['enable_button'] in (of['enable_turbo_button'], of['pause_button']):
            raise EndoscopeError(f'enable_button {of["enable_button"]} has another meaning too')
        self._enable = int(of['enable_button'])
        self._turbo = int(of['enable_turbo_button'])
        self._pause = int(of['pause_button'])
        self._axes = [int(of[f'axis_angular.{joint}']) for joint in _JOINTS]
        # In rad/s at full deflection, usual and turbo, shape (2, 2), one row a joint.
        self.speeds = tuple(
            (float(of[f'scale_angular.{joint}']), float(of[f'scale_angular_turbo.{joint}']))
            for joint in _JOINTS
        )
        self.pause = False  # whether the last message pressed the pause button
        self._pausing = self._pressed = False
        self._seq = self._grip = 0

    def frame(self, axes: Sequence[float], buttons: Sequence[int], stamp_s: float) -> InputFrame:
        """Take a message: deflections from -1 to 1, and 1 for each button that is pressed."""
        needed = max(self._enable, self._turbo, self._pause)
        if len(buttons) <= needed or len(axes) <= max(self._axes):
            raise MalformedFrameError(
                f'joy has {len(buttons)} buttons and {len(axes)} axes; button {needed} and axis '
                f'{max(self._axes)} are needed'
            )
        x, y = (float(axes[axis]) for axis in self._axes)
        if not (math.isfinite(x) and math.isfinite(y)):
            raise MalformedFrameError(f'joy has deflections {x} and {y}')
        turbo = self._turbo >= 0 and buttons[self._turbo] == 1
        pressed = turbo or buttons[self._enable] == 1
        pausing = self._pause >= 0 and buttons[self._pause] == 1
        self.pause, self._pausing = pausing and not self._pausing, pausing
        self._grip += pressed and not self._pressed
        self._pressed = pressed
        self._seq += 1
        return InputFrame(
            pressed=pressed,
            turbo=turbo,
            visible=True,
            focused=True,
            position_mode=False,
            source=Source.JOY,
            seq=self._seq,
            grip=self._grip,
            seen=0,
            t=stamp_s,
            x=x,
            y=y,
        )


def _checked(name: str, value: Any) -> Any:
    """Check one parameter."""
    if name not in DEFAULTS:
        raise EndoscopeError(f"there is no parameter '{name}' of joy: {nearest(name, DEFAULTS)}")
    default = DEFAULTS[name]
    if isinstance(default, bool) or isinstance(value, bool):
        fits = isinstance(default, bool) and isinstance(value, bool)
        wanted = 'true or false' if isinstance(default, bool) else 'a number'
    elif isinstance(default, int):
        least = -1 if name in _MAY_BE_NONE else 0
        fits, wanted = isinstance(value, int) and value >= least, f'a number from {least}'
    else:
        fits = isinstance(value, int | float) and math.isfinite(value) and value != 0.0
        wanted = 'a finite speed in rad/s, not 0'
    if not fits:
        raise EndoscopeError(f'{name} = {value} must be {wanted}')
    return value
