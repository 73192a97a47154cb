"""Reads registers of a transmitter and matches each reply to its request."""

import time
from dataclasses import dataclass

from endoscope_devices.load_cells.modbus_framing import Framing, ReplyError, ReplyTrouble
from endoscope_devices.load_cells.modbus_line import LONGEST, Line

# After each fence that failed, the next waits for a longer silence: the fewer are under way at a
# time, the later an answer may come and still be matched to its request.
_LONGER = 8
_LONGEST_SILENCE_NS = 1_000_000_000


@dataclass(frozen=True)
class RegisterReading:
    """16-bit registers with the time at which they were asked for."""

    asked_ns: int  # of ``time.monotonic_ns``
    registers: tuple[int, ...]


class RegisterReader:
    """One request at a time on one line, which the caller has opened.

    Modbus RTU replies do not identify their request: a late one looks like the reply to the next.
    So after a time-out, and after unsolicited bytes, a fence is set: another number of registers is
    requested, and until its reply has come, which a transmitter sends in order, all replies are
    ignored. Consecutive fences request different numbers: a late reply to one of them must not open
    the next.
    """

    def __init__(self, line: Line, framing: Framing, reply_timeout: float) -> None:
        self._line = line
        self._framing = framing
        self._timeout_ns = round(reply_timeout * 1e9)
        self._fenced = False
        self._fences = 0  # put up so far
        self._silence_ns = self._timeout_ns // 4  # which the next fence waits for
        self.unexpected = 0  # bytes that came without a question

    def read(self, address: int, count: int) -> RegisterReading:
        """Read registers; ReplyError where no acceptable reply comes in time."""
        waiting = len(self._line.read(LONGEST, 0))
        self.unexpected += waiting
        if waiting or self._fenced:
            self._fence(address, count)
        try:
            return self._ask(address, count)
        except ReplyError:
            self._fenced = True
            raise

    def _fence(self, address: int, count: int) -> None:
        self._fenced = True
        # A line that is never silent is asked all the same, and answers with nothing acceptable.
        latest = time.monotonic_ns() + _LONGEST_SILENCE_NS
        while (now := time.monotonic_ns()) < latest:
            if not self._line.read(LONGEST, now + self._silence_ns):
                break
        self._silence_ns = min(_LONGER * self._silence_ns, _LONGEST_SILENCE_NS)
        others = range(1, count) if count > 1 else range(2, 5)
        self._fences += 1
        try:
            self._ask(address, others[self._fences % len(others)])
        except ReplyError as error:
            # A refusal answers the fence's own question as well: two registers may not exist.
            if error.trouble is not ReplyTrouble.REFUSED:
                raise
        self._fenced = False
        self._silence_ns = self._timeout_ns // 4

    def _ask(self, address: int, count: int) -> RegisterReading:
        asked = time.monotonic_ns()
        deadline = asked + self._timeout_ns
        self._line.write(self._framing.request(address, count))
        while True:
            registers = self._framing.accept(self._reply(deadline))
            if registers is not None:
                return RegisterReading(asked, registers)

    def _reply(self, deadline_ns: int) -> bytes:
        data = b''
        while len(data) < min(self._framing.length(data), LONGEST):
            part = self._line.read(self._framing.length(data) - len(data), deadline_ns)
            if not part:
                raise ReplyError(
                    ReplyTrouble.SILENCE,
                    f'{len(data)} bytes within {self._timeout_ns * 1e-6:.0f} ms',
                )
            data += part
        return data
