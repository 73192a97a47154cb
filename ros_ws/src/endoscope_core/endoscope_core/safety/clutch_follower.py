"""Follows a console handle while the clutch is held, and re-references when it is engaged again."""

from collections.abc import Sequence


class ClutchFollower:
    """Turns handle positions into slave positions without a jump at engagement.

    While engaged, ``slave = anchor + scale * (handle - handle at engagement)``, where the anchor is
    the slave position at engagement.  The handle may move freely while the clutch is open.

    Parameters
    ----------
    scale
        Slave motion for one radian of handle motion.
    low, high
        Where the slave position is held back, in rad, shape (J,).
    """

    def __init__(self, scale: float, low: Sequence[float], high: Sequence[float]) -> None:
        self.scale = scale
        self._limits = tuple(zip(low, high, strict=True))
        self._slave_anchor: tuple[float, ...] | None = None
        self._handle_anchor: tuple[float, ...] = ()

    @property
    def engaged(self) -> bool:
        """Whether the slave follows the handle."""
        return self._slave_anchor is not None

    def engage(self, handle: Sequence[float], slave: Sequence[float]) -> None:
        """Begin to follow from the handle and slave positions of now, in rad, shape (J,)."""
        self._handle_anchor = tuple(handle)
        self._slave_anchor = tuple(slave)

    def release(self) -> None:
        """Stop following."""
        self._slave_anchor = None

    def follow(self, handle: Sequence[float]) -> tuple[float, ...]:
        """Slave position for a handle position, in rad, shape (J,).

        Raises
        ------
        RuntimeError
            The clutch is not engaged.
        """
        if self._slave_anchor is None:
            raise RuntimeError('the clutch is not engaged: call engage first')
        return tuple(
            min(high, max(low, anchor + self.scale * (h - start)))
            for h, anchor, start, (low, high) in zip(
                handle, self._slave_anchor, self._handle_anchor, self._limits, strict=True
            )
        )
