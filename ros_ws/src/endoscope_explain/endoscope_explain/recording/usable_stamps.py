"""Header stamps that a recording can be put in order by, or a refusal that says why not."""

from collections.abc import Sequence

import numpy as np

from endoscope_bags.errors import BagError
from endoscope_bags.joint_state_series import JointStateSeries

STRAY_NS = 10_000_000_000
"""Further from its receipt than the others of its topic by this, a stamp is no delay."""


class UnusableStampsError(BagError):
    """The stamps of a topic say nothing about when its messages were made."""


def without_stray(series: JointStateSeries) -> tuple[JointStateSeries, list[str]]:
    """Leave out messages stamped far from their receipt, unlike the others; and say so."""
    delay = series.log_ns - series.stamp_ns
    far = np.abs(delay - np.median(delay)) > STRAY_NS
    # Where most are far, the clock runs at another rate, or counts in another unit: see the audit.
    few = far.any() and np.count_nonzero(far) < 0.5 * len(far)
    if not few or np.ptp(series.stamp_ns) <= np.ptp(series.log_ns) + STRAY_NS:
        return series, []
    seconds = int(series.stamp_ns[far][0]) * 1e-9
    note = (
        f'{int(far.sum())} of {len(series)} messages of {series.topic} are left out: their stamps '
        f'are far from when they were received (the first is stamped {seconds:.3f} s)'
    )
    return series.ordered(np.flatnonzero(~far)), [note]


def require_running_stamps(path: object, series: JointStateSeries) -> None:
    """Raise UnusableStampsError where several messages of a topic all have one stamp."""
    if len(series) > 1 and np.ptp(series.stamp_ns) == 0:
        raise UnusableStampsError(
            f'{path}: all {len(series)} messages of {series.topic} are stamped '
            f'{int(series.stamp_ns[0]) * 1e-9:.3f} s: its driver must set the header'
        )


def require_common_time(path: object, topics: Sequence[JointStateSeries]) -> None:
    """Refuse topics that cannot be laid beside each other; the first one is that of the commands.

    UnusableStampsError if all of a topic's messages, two at least, have one stamp, or two topics no
    time in common.
    """
    for one in topics:
        require_running_stamps(path, one)
    commands = topics[0]
    origin = int(commands.stamp_ns.min())
    for one in topics[1:]:
        begin, end = int(one.stamp_ns.min()), int(one.stamp_ns.max())
        if begin > commands.stamp_ns.max() or end < origin:
            raise UnusableStampsError(
                f'{path}: {one.topic} is stamped from {(begin - origin) * 1e-9:.3f} to '
                f'{(end - origin) * 1e-9:.3f} s after the first command of {commands.topic}, the '
                f'last of which is at {int(np.ptp(commands.stamp_ns)) * 1e-9:.3f} s: record both '
                'by one clock'
            )
