"""A handle made of a page's pad, keys or stick: frames in, angles at every beat out."""

from collections.abc import Sequence

from endoscope_console.teleop.frames import InputFrame
from endoscope_core.teleop import RunningAngles

_RAMP_NS = 20_000_000
# A beat that comes later than a command lives makes up for no more than this.
_LONGEST_NS = 100_000_000
_NS = 1e-9
SPEEDS = (0.5, 1.0)
"""Of a joint at full deflection, by the usual and by the fast dead-man, rad/s."""


class PadHandle:
    """A handle whose angles follow a deflection or a drag while the clutch is held.

    In speed mode the angles run (:class:`RunningAngles`). In position mode each frame is followed
    over the 20 ms to the next: 50 steps a second would be spikes of speed at 1 kHz. `speeds` (J, 2)
    are in rad/s at full deflection, usual and fast, `limits` (J,) in rad/s those of a drag.
    """

    def __init__(
        self, joints: int, speeds: Sequence[tuple[float, float]], limits: Sequence[float]
    ) -> None:
        if not len(speeds) == len(limits) == joints:
            raise ValueError(f'{joints} joints, {len(speeds)} speeds and {len(limits)} limits')
        self._speeds = tuple(speeds)
        self._limits = tuple(limits)
        self._angles = RunningAngles(joints)
        self._followed_ns: int | None = None
        self._grip: int | None = None
        self._seq = 0
        self._began = self._goal = tuple(self._angles.position)
        self._due_ns = 0

    def follow(
        self,
        now_ns: int,
        frame: InputFrame | None = None,
        wanted: Sequence[float] | None = None,
        scale: float = 1.0,
    ) -> tuple[float, ...]:
        """Angles (J,) in rad at this beat, by the newest frame of the grip that is engaged.

        `wanted` (J,) is what the master asks of the slave, in rad; `scale` the slave's motion for
        one radian of the handle.
        """
        elapsed_ns = 0 if self._followed_ns is None else now_ns - self._followed_ns
        elapsed_ns = min(max(0, elapsed_ns), _LONGEST_NS)
        self._followed_ns = now_ns
        if frame is None:
            self._grip = None
            self._angles.release()
        elif frame.grip != self._grip:
            self._grip, self._seq = frame.grip, frame.seq
            self._began = self._goal = tuple(self._angles.position)
            if frame.position_mode:
                # What was dragged before the clutch engaged moves nothing.
                self._began = tuple(b - x for b, x in zip(self._began, _of(frame), strict=True))
        elif frame.position_mode:
            self._drag(frame, now_ns, elapsed_ns)
        else:
            self._run(frame, elapsed_ns * _NS, wanted, scale)
        return tuple(self._angles.position)

    def _drag(self, frame: InputFrame, now_ns: int, elapsed_ns: int) -> None:
        if frame.seq != self._seq:
            self._seq = frame.seq
            self._goal = tuple(b + x for b, x in zip(self._began, _of(frame), strict=True))
            self._due_ns = now_ns + _RAMP_NS - elapsed_ns
        position = self._angles.position
        left_ns = max(elapsed_ns, self._due_ns - (now_ns - elapsed_ns))
        share = elapsed_ns / left_ns if left_ns else 0.0
        for joint, (goal, limit) in enumerate(zip(self._goal, self._limits, strict=True)):
            most = limit * elapsed_ns * _NS
            step = share * (goal - position[joint])
            position[joint] += max(-most, min(most, step))

    def _run(
        self, frame: InputFrame, elapsed: float, wanted: Sequence[float] | None, scale: float
    ) -> None:
        usual = [abs(speed[frame.turbo]) for speed in self._speeds]
        speeds = [
            speed[frame.turbo] * max(-1.0, min(1.0, deflection))
            for speed, deflection in zip(self._speeds, _of(frame), strict=True)
        ]
        self._angles.run(speeds, usual, elapsed, wanted, scale)


def _of(frame: InputFrame) -> tuple[float, float]:
    return frame.x, frame.y
