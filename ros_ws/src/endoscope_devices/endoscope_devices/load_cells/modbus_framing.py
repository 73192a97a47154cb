"""Modbus requests and replies as bytes, by pymodbus; only the one right reply is accepted.

Frames follow "Modbus over Serial Line" V1.02 (RTU, sections 2.3 and 2.5.1: CRC-16, polynomial
A001h, start FFFFh) and "Modbus Messaging on TCP/IP" V1.0b (MBAP header, section 3.1.3); functions 3
and 4 follow "Modbus Application Protocol" V1.1b3, sections 6.3 and 6.4.  pymodbus's clients hunt
for a frame in whatever arrives and repeat requests; here a reply is known by its length before it
is read, and anything else is an error that is counted by kind.
"""

from abc import ABC, abstractmethod
from enum import StrEnum

from pymodbus.exceptions import ModbusIOException
from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU, ExceptionResponse
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadHoldingRegistersResponse,
    ReadInputRegistersRequest,
    ReadInputRegistersResponse,
)

_REQUESTS = {3: ReadHoldingRegistersRequest, 4: ReadInputRegistersRequest}
_REPLIES = {3: ReadHoldingRegistersResponse, 4: ReadInputRegistersResponse}
_MBAP = 7


class ReplyTrouble(StrEnum):
    """Why a reply is not accepted."""

    SILENCE = 'no reply'
    CHECKSUM = 'wrong CRC'
    MALFORMED = 'malformed'
    REFUSED = 'refused by the transmitter'


class ReplyError(Exception):
    """A reply that is not accepted, with the kind of error."""

    def __init__(self, trouble: ReplyTrouble, words: str) -> None:
        super().__init__(f'{trouble}: {words}')
        self.trouble = trouble


class Framing(ABC):
    """How requests of function 3 or 4 and replies lie in bytes; one request is out at a time."""

    def __init__(self, unit: int, function: int) -> None:
        self._unit = unit
        self._function = function
        self._count = 0
        self._decoder = DecodePDU(False)

    @abstractmethod
    def request(self, address: int, count: int) -> bytes:
        """Bytes that ask for `count` registers from `address` on."""

    @abstractmethod
    def length(self, head: bytes) -> int:
        """Length of the reply, as far as its first bytes determine it.

        Always at least two bytes more than those that determine it.
        """

    @abstractmethod
    def accept(self, reply: bytes) -> tuple[int, ...] | None:
        """Registers of the reply to the last request, None for an earlier one; or ReplyError."""

    def _pdu(self, address: int, count: int, transaction: int = 0) -> ReadHoldingRegistersRequest:
        self._count = count
        return _REQUESTS[self._function](
            address=address, count=count, dev_id=self._unit, transaction_id=transaction
        )

    def _registers(self, unit: int, pdu: bytes) -> tuple[int, ...]:
        if unit != self._unit:
            raise ReplyError(ReplyTrouble.MALFORMED, f'from unit {unit} instead of {self._unit}')
        if len(pdu) == 2 and pdu[0] == self._function | 0x80:
            raise ReplyError(ReplyTrouble.REFUSED, f'Modbus exception {pdu[1]}')
        size = 2 * self._count
        if pdu[0] != self._function or len(pdu) != 2 + size or pdu[1] != size:
            raise ReplyError(ReplyTrouble.MALFORMED, f'{len(pdu)} bytes of function {pdu[0]}')
        try:
            reply = self._decoder.decode(pdu)
        except ModbusIOException as error:
            raise ReplyError(ReplyTrouble.MALFORMED, str(error)) from error
        if isinstance(reply, ExceptionResponse) or type(reply) is not _REPLIES[self._function]:
            raise ReplyError(ReplyTrouble.MALFORMED, f'a {type(reply).__name__}')
        return tuple(reply.registers)


class RtuFraming(Framing):
    """Modbus RTU; parameters as of :class:`Framing`."""

    def __init__(self, unit: int, function: int) -> None:
        super().__init__(unit, function)
        self._framer = FramerRTU(self._decoder)

    def request(self, address: int, count: int) -> bytes:
        """See :class:`Framing`."""
        return self._framer.buildFrame(self._pdu(address, count))

    def length(self, head: bytes) -> int:
        """See :class:`Framing`: address, function, byte count or exception code, data, CRC."""
        if len(head) < 3 or head[1] & 0x80:
            return 5
        return 5 + head[2]

    def accept(self, reply: bytes) -> tuple[int, ...] | None:
        """See :class:`Framing`; RTU replies have no transaction number to detect an earlier one."""
        if len(reply) < 5:
            raise ReplyError(ReplyTrouble.MALFORMED, f'{len(reply)} bytes')
        if not FramerRTU.check_CRC(reply[:-2], int.from_bytes(reply[-2:], 'big')):
            raise ReplyError(ReplyTrouble.CHECKSUM, f'in {len(reply)} bytes')
        return self._registers(reply[0], reply[1:-2])


class TcpFraming(Framing):
    """Modbus TCP; parameters as of :class:`Framing`."""

    def __init__(self, unit: int, function: int) -> None:
        super().__init__(unit, function)
        self._framer = FramerSocket(self._decoder)
        self._transaction = 0

    def request(self, address: int, count: int) -> bytes:
        """See :class:`Framing`; each request has a transaction number of its own."""
        self._transaction = self._transaction % 0xFFFF + 1
        return self._framer.buildFrame(self._pdu(address, count, self._transaction))

    def length(self, head: bytes) -> int:
        """See :class:`Framing`: the header's length field counts from the unit on."""
        if len(head) < _MBAP:
            return _MBAP + 2
        return 6 + int.from_bytes(head[4:6], 'big')

    def accept(self, reply: bytes) -> tuple[int, ...] | None:
        """See :class:`Framing`."""
        if len(reply) < _MBAP + 2 or len(reply) != self.length(reply) or reply[2:4] != b'\0\0':
            raise ReplyError(ReplyTrouble.MALFORMED, f'header {reply[:_MBAP].hex(" ")}')
        _, unit, transaction, pdu = self._framer.decode(reply)
        if transaction != self._transaction:
            return None
        return self._registers(unit, pdu)
