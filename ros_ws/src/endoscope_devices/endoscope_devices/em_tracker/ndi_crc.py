"""The checksum of NDI's serial protocol."""


def crc16(data: bytes) -> int:
    """CRC-16/ARC: x^16 + x^15 + x^2 + 1, reflected, starting from 0.

    Aurora Application Program Interface Guide, appendix on calculating CRC; ``INIT:`` gives E3A5.
    """
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return crc
