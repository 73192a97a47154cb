"""Changes from one source of commands to another without a jump."""

from collections.abc import Sequence


class BumplessOutput:
    """Adds to a raw output the offset that a change of source would cause, and fades it out.

    At a change the offset is what was put out before minus what the new source asks for; it shrinks
    to zero along a minimum-jerk curve (Flash and Hogan 1985), so that position and speed stay
    continuous whatever the sources are.

    Parameters
    ----------
    joints
        Number of joints J.
    duration
        Shortest fade in s.
    speed
        The fade adds at most this speed in rad/s; a larger offset takes longer.
    """

    _PEAK_SLOPE = 1.875

    def __init__(self, joints: int, duration: float, speed: float) -> None:
        self._shortest = duration
        self._speed = speed
        self._offset = [0.0] * joints
        self._length = duration
        self._elapsed = duration
        self._from: tuple[float, ...] | None = None
        self.output: tuple[float, ...] = (0.0,) * joints

    @property
    def settled(self) -> bool:
        """Whether the output follows its source exactly."""
        return self._from is None and self._elapsed >= self._length

    def change(self, start: Sequence[float] | None = None) -> None:
        """Let the next step begin a fade from ``start`` (J,) in rad, or from the last output."""
        self._from = self.output if start is None else tuple(start)

    def step(self, raw: Sequence[float], dt: float) -> tuple[float, ...]:
        """Put out the next command.

        Parameters
        ----------
        raw
            What the source asks for in rad, shape (J,).
        dt
            Seconds since the step before.

        Returns
        -------
        tuple of float
            Shape (J,), rad.
        """
        if self._from is not None:
            self._offset = [a - b for a, b in zip(self._from, raw, strict=True)]
            largest = max(abs(x) for x in self._offset)
            self._length = max(self._shortest, self._PEAK_SLOPE * largest / self._speed)
            self._elapsed = 0.0
            self._from = None
            self.output = tuple(a + b for a, b in zip(self._offset, raw, strict=True))
            return self.output
        if self._elapsed >= self._length:
            self.output = tuple(raw)
            return self.output
        self._elapsed = min(self._elapsed + dt, self._length)
        s = self._elapsed / self._length
        fade = 1.0 - s * s * s * (10.0 + s * (6.0 * s - 15.0))
        self.output = tuple(x * fade + r for x, r in zip(self._offset, raw, strict=True))
        return self.output
