"""Counts lost messages by the gaps in the numbers that publishers give them."""

from collections.abc import Callable

# Every message is compared with the last one of each; numbers at random would make thousands.
_MOST_PUBLISHERS = 64
_MOST_GAPS = 64


class SequenceGaps:
    """Lost messages of one topic.

    DDS numbers the messages of every publisher from 1. Where several publish on a topic, their
    numbers arrive mixed and unlabelled; each number is taken for the publisher that expects it.
    """

    def __init__(self) -> None:
        self.received = 0
        self.lost = 0  # between the first and the last that came; late ones are none
        self._last: list[int] = []
        # First and last number of what is missing; the latest gaps only.
        self._missing: list[tuple[int, int]] = []

    def add(self, sequence: int, count_publishers: Callable[[], int] = lambda: 1) -> int:
        """Note a message and return how many were lost directly before it."""
        self.received += 1
        last = self._last
        for k, before in enumerate(last):
            if before + 1 == sequence:
                last[k] = sequence
                return 0
        if self._came_late(sequence):
            return 0
        earlier = [k for k, before in enumerate(last) if before < sequence]
        if not earlier and len(last) >= _MOST_PUBLISHERS:
            last[min(range(len(last)), key=last.__getitem__)] = sequence
            return 0
        # Asked in case of doubt only. An unexpected number begins a new publisher as long as fewer
        # were seen, and is a loss after that.
        if not earlier or len(last) < count_publishers():
            last.append(sequence)
            return 0
        nearest = max(earlier, key=lambda k: last[k])
        gap = sequence - last[nearest] - 1
        last[nearest] = sequence
        self.lost += gap
        if gap:
            self._missing = [*self._missing, (sequence - gap, sequence - 1)][-_MOST_GAPS:]
        return gap

    def _came_late(self, sequence: int) -> bool:
        for k, (first, final) in enumerate(self._missing):
            if first <= sequence <= final:
                rest = [(first, sequence - 1), (sequence + 1, final)]
                self._missing[k : k + 1] = [(a, b) for a, b in rest if a <= b]
                self.lost -= 1
                return True
        return False
