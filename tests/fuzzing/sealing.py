"""Checksums of changed files made right again: without them a fuzzer sees little of a reader but its first check."""

from __future__ import annotations

import struct
import zlib
from functools import lru_cache

_PNG = b"\x89PNG\r\n\x1a\n"
_HDF5 = b"\x89HDF\r\n\x1a\n"
_WORD = 0xFFFFFFFF
_TIMES, _PHASES, _ORDERED = 0x20, 0x10, 0x04  # flags of an object header
_CONTINUATION = 16  # type of message


def sealed(data: bytes) -> bytes:
    """The same bytes, those of checksums in PNG and HDF5 apart."""
    whole = bytearray(data)
    if data.startswith(_PNG):
        _png(whole)
    elif data.startswith(_HDF5):
        _hdf5(whole)
    return bytes(whole)


def _png(whole: bytearray) -> None:
    at = len(_PNG)
    while at + 12 <= len(whole):
        end = at + 8 + int.from_bytes(whole[at : at + 4], "big")
        if end + 4 > len(whole):
            break
        whole[end : end + 4] = zlib.crc32(whole[at + 4 : end]).to_bytes(4, "big")
        at = end + 4


def _hdf5(whole: bytearray) -> None:
    """Superblock of version 2 or 3, object headers of version 2 and their continuations."""
    if len(whole) >= 48 and whole[8] in (2, 3):
        _put(whole, 0, 44)
    at = whole.find(b"OHDR")
    while at >= 0:
        if at + 6 < len(whole):
            flags = whole[at + 5]
            begin = at + 6 + (16 if flags & _TIMES else 0) + (4 if flags & _PHASES else 0)
            width = 1 << (flags & 3)
            end = begin + width + int.from_bytes(whole[begin : begin + width], "little")
            _continued(whole, begin + width, end, 6 if flags & _ORDERED else 4)
            _put(whole, at, end)
        at = whole.find(b"OHDR", at + 4)


def _continued(whole: bytearray, at: int, end: int, prefix: int) -> None:
    """Seal what the messages of a header between two places continue with."""
    while at + prefix <= min(end, len(whole)):
        size = int.from_bytes(whole[at + 1 : at + 3], "little")
        if whole[at] == _CONTINUATION and size >= 16 and at + prefix + 16 <= len(whole):
            place, length = struct.unpack_from("<QQ", whole, at + prefix)
            if length > 8 and whole[place : place + 4] == b"OCHK":
                _put(whole, place, place + length - 4)
        at += prefix + size


def _put(whole: bytearray, begin: int, end: int) -> None:
    if end + 4 <= len(whole):
        whole[end : end + 4] = lookup3(bytes(whole[begin:end])).to_bytes(4, "little")


@lru_cache(1 << 14)
def lookup3(key: bytes) -> int:
    """Checksum of HDF5's metadata: Bob Jenkins's hashlittle of 2006.

    >>> hex(lookup3(b"Four score and seven years ago"))
    '0x17770551'
    """
    a = b = c = (0xDEADBEEF + len(key)) & _WORD
    if not key:
        return c
    last = (len(key) - 1) // 12 * 12
    for x, y, z in struct.iter_unpack("<III", key[:last]):
        a, b, c = (a + x) & _WORD, (b + y) & _WORD, (c + z) & _WORD
        for turn in (4, 6, 8, 16, 19, 4):
            a = ((a - c) & _WORD) ^ _turned(c, turn)
            a, b, c = b, (c + b) & _WORD, a
    x, y, z = struct.unpack("<III", key[last:].ljust(12, b"\0"))
    a, b, c = (a + x) & _WORD, (b + y) & _WORD, (c + z) & _WORD
    for turn in (14, 11, 25, 16, 4, 14, 24):
        a, b, c = b, ((c ^ b) - _turned(b, turn)) & _WORD, a
    return b


def _turned(word: int, places: int) -> int:
    return (word << places) & _WORD | word >> (32 - places)
