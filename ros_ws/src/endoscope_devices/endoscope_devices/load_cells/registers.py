"""How numbers lie in 16-bit Modbus registers."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class RegisterType:
    """A type by its number of registers and its format in the ``struct`` module."""

    registers: int
    format: str


REGISTER_TYPES = {
    'int16': RegisterType(1, '>h'),
    'uint16': RegisterType(1, '>H'),
    'int32': RegisterType(2, '>i'),
    'uint32': RegisterType(2, '>I'),
    'float32': RegisterType(2, '>f'),
}


def decode_number(registers: Sequence[int], kind: str, big_word_first: bool) -> float:
    """A number in counts, of a type `kind` of ``REGISTER_TYPES``, from its 16-bit registers.

    Bytes within a register are big-endian (Modbus Application Protocol V1.1b3, section 4.2); the
    order of registers is the maker's choice. May be NaN for ``float32``.
    """
    words = registers if big_word_first else tuple(reversed(registers))
    raw = struct.pack(f'>{len(words)}H', *words)
    return float(struct.unpack(REGISTER_TYPES[kind].format, raw)[0])
