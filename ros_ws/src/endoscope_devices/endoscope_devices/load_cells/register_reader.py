"""Asks a transmitter for registers and makes sure that the answer belongs to the question."""

import time
from dataclasses import dataclass

from endoscope_devices.load_cells.modbus_framing import Framing, ReplyError, ReplyTrouble
from endoscope_devices.load_cells.modbus_line import LONGEST, Line


@dataclass(frozen=True)
class RegisterReading:
    """16-bit registers with the time at which they were asked for."""

    asked_ns: int  # of ``time.monotonic_ns``
    registers: tuple[int, ...]


class RegisterReader:
    """One question at a time on one line, which the caller has opened.

    Modbus RTU replies do not say which request they answer: a late one looks like the answer to the
    next. So after a silence, and after bytes that nobody asked for, a fence is put up: registers
    are asked for in another number, and until the answer to that has come, which a transmitter
    gives in order, nothing counts.
    """

    def __init__(self, line: Line, framing: Framing, reply_timeout: float) -> None:
        self._line = line
        self._framing = framing
        self._timeout_ns = round(reply_timeout * 1e9)
        self._fenced = False
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
        while self._line.read(LONGEST, time.monotonic_ns() + self._timeout_ns // 4):
            pass
        try:
            self._ask(address, 1 if count > 1 else 2)
        except ReplyError as error:
            # A refusal answers the fence's own question as well: two registers may not exist.
            if error.trouble is not ReplyTrouble.REFUSED:
                raise
        self._fenced = False

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
