"""When a frame was measured, told by its number rather than by when its reply happened to come."""

_DRIFT = 1e-4


class FrameClock:
    """Lays frame numbers on the host's clock, at `rate` frames a second.

    Frames are equally spaced; a reply comes after its frame by a time that varies. The earliest
    reply, relative to its number, shows where the frames lie (NDI advises to use the frame number,
    not the host's clock, to tell when data was collected). The line follows clocks that drift apart
    by up to ``1e-4``.
    """

    def __init__(self, rate: float) -> None:
        self._period_ns = 1e9 / rate
        self._offset_ns: float | None = None
        self._frame = 0

    def stamp(self, frame: int, asked_ns: int) -> int:
        """Time of a frame seen for the first time, in ns, never later than `asked_ns`.

        The frame's number is larger than the last; `asked_ns` is when the reply that brought it was
        asked for, in ns of the same clock.
        """
        seen = asked_ns - frame * self._period_ns
        self._offset_ns = seen if self._offset_ns is None else min(seen, self._latest_ns(frame))
        self._frame = frame
        return round(self._offset_ns + frame * self._period_ns)

    def ahead_ns(self, frame: int, asked_ns: int) -> int:
        """How much earlier than it can have been measured a frame was seen; 0 if it was not."""
        if self._offset_ns is None:
            return 0
        return max(0, round(self._latest_ns(frame) + frame * self._period_ns - asked_ns))

    def _latest_ns(self, frame: int) -> float:
        """Latest time of frame 0, after what the clocks may have drifted until a frame."""
        passed = (frame - self._frame) * self._period_ns
        return (self._offset_ns or 0.0) + _DRIFT * passed
