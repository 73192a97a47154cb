"""Angles of a handle that no device measures: they run at a speed, and wait for the slave."""

from collections.abc import Sequence

# So long ahead of what the console says that it wants the hand waits: it is at a limit.
_LEAD_S = 0.2
_LEAD_RAD = 0.002


class RunningAngles:
    """Angles that run while a grip holds, stay over its end, and do not wind up at a limit.

    What the console wants of the slave tells where a limit is, be it of the joint, of the tube or
    of the console's own: the angles wait there, and turn round at once.
    """

    def __init__(self, joints: int) -> None:
        self.position = [0.0] * joints  # rad, (J,)
        self._start: tuple[Sequence[float], Sequence[float]] | None = None

    def release(self) -> None:
        """End the grip."""
        self._start = None

    def run(
        self,
        speed: Sequence[float],
        usual: Sequence[float],
        elapsed: float,
        wanted: Sequence[float] | None,
        scale: float,
    ) -> tuple[bool, ...]:
        """Go on at `speed` (J,) in rad/s, and tell which joints (J,) follow no further.

        `usual` (J,) is the greatest speed in rad/s for which the slave is given time to follow,
        `elapsed` the time in s since the last call of this grip, `scale` slave motion for one
        radian of the handle. `wanted` (J,) are the angles in rad that the console asks of the slave
        now; None while it follows nobody: the angles do not move before it does, nor away from what
        it has reached.
        """
        at_limit = [False] * len(self.position)
        if wanted is None:
            return tuple(at_limit)
        if self._start is None:
            self._start = tuple(self.position), tuple(wanted)
        begun, wanted_then = self._start
        for joint, v in enumerate(speed):
            way = (v > 0.0) - (v < 0.0)
            lead = scale * (self.position[joint] - begun[joint])
            lead -= wanted[joint] - wanted_then[joint]
            at_limit[joint] = bool(way) and way * lead > _LEAD_S * usual[joint] * scale + _LEAD_RAD
            if not at_limit[joint]:
                self.position[joint] += v * elapsed
        return tuple(at_limit)
