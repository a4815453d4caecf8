"""The CRC-32 of a datagram that carries it: IEEE 802.3, as in zlib, over all bytes, with its own four as zero."""

import struct
import zlib

__all__ = ["crc_of", "with_crc"]

_CRC = struct.Struct("<I")


def crc_of(datagram: bytes, at: int) -> int:
    """CRC-32 that a datagram should carry at an offset."""
    blank = bytearray(datagram)
    _CRC.pack_into(blank, at, 0)
    return zlib.crc32(blank)


def with_crc(datagram: bytes, at: int) -> bytes:
    """The datagram with its CRC-32 filled in at an offset."""
    filled = bytearray(datagram)
    _CRC.pack_into(filled, at, 0)
    _CRC.pack_into(filled, at, zlib.crc32(filled))
    return bytes(filled)
