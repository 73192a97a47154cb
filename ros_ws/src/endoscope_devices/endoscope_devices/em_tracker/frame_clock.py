"""When a frame was measured, told by its number rather than by when its reply happened to come."""

_DRIFT = 1e-4


class FrameClock:
    """Lays frame numbers on the host's clock.

    Frames are equally spaced; a reply comes after its frame by a time that varies.  The earliest
    reply, relative to its number, shows where the frames lie (NDI advises to use the frame number,
    not the host's clock, to tell when data was collected).  The line follows clocks that drift
    apart by up to ``1e-4``.

    Parameters
    ----------
    rate
        Frames a second in Hz.
    """

    def __init__(self, rate: float) -> None:
        self._period_ns = 1e9 / rate
        self._offset_ns: float | None = None
        self._frame = 0

    def stamp(self, frame: int, asked_ns: int) -> int:
        """Time of a frame that was seen for the first time.

        Parameters
        ----------
        frame
            Its number, larger than the last; a smaller one begins anew.
        asked_ns
            When the reply that brought it was asked for, in ns.

        Returns
        -------
        int
            In ns of the same clock, never later than ``asked_ns``.
        """
        seen = asked_ns - frame * self._period_ns
        if self._offset_ns is None or frame <= self._frame:
            self._offset_ns = seen
        else:
            passed = (frame - self._frame) * self._period_ns
            self._offset_ns = min(seen, self._offset_ns + _DRIFT * passed)
        self._frame = frame
        return round(self._offset_ns + frame * self._period_ns)
