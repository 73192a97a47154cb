"""Notices motors that stand still though they are told to move."""

from collections.abc import Sequence

TOLD_RAD = 0.02
"""13 counts of an encoder of 4096.  With the position gain that an XM430-W350 comes with (800, that
is 6.25 of 885 steps of duty for a count) they are worth 9 % of its stall torque of 4.1 N m, or
0.4 N m: several times what wires of 60 N on a pulley of 2.4 mm hold (e-Manual, control table,
Position P Gain)."""
PATIENCE_NS = 300_000_000


class StandingStill:
    """Compares what motors are told with what they do.

    A motor fails to answer once its goal has been further than `TOLD_RAD` from what it was when
    the shaft came to rest, for `PATIENCE_NS`, and the shaft has not turned since.  A constant
    difference is none: a servo under load stands beside its goal.

    Parameters
    ----------
    names
        Of the J motors.
    resolution
        One count of their encoders in rad; a shaft that turns by no more than two stands still.
    """

    def __init__(self, names: Sequence[str], resolution: float) -> None:
        self._names = tuple(names)
        self._still = 2.0 * resolution
        self.restart()

    def restart(self) -> None:
        """Begin anew, as where nothing is commanded."""
        self._rest: list[float] = []
        self._goal_at_rest: list[float] = []
        self._told_ns: list[int | None] = []

    def look(
        self, goal: Sequence[float], measured: Sequence[float] | None, measured_ns: int
    ) -> str:
        """Take goal and shaft angles in rad, shape (J,), measured at a monotonic time in ns.

        Returns
        -------
        str
            Which motor stands still, and how far it was told to go; empty where all answer.
        """
        if measured is None:
            self.restart()
            return ''
        if not self._rest:
            self._rest, self._goal_at_rest = list(measured), list(goal)
            self._told_ns = [None] * len(self._rest)
        for k, (wanted, shaft) in enumerate(zip(goal, measured, strict=True)):
            if abs(shaft - self._rest[k]) > self._still:
                self._rest[k], self._goal_at_rest[k] = shaft, wanted
            if abs(wanted - self._goal_at_rest[k]) <= TOLD_RAD:
                self._told_ns[k] = None
                continue
            told_ns = self._told_ns[k]
            if told_ns is None:
                self._told_ns[k] = measured_ns
            elif measured_ns - told_ns >= PATIENCE_NS:
                return (
                    f'{self._names[k]} stands still: its goal has gone '
                    f'{abs(wanted - self._goal_at_rest[k]):.2g} rad, and it has not turned for '
                    f'{(measured_ns - told_ns) * 1e-9:.1f} s'
                )
        return ''
