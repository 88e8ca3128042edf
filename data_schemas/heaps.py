"""Looks over the one part of an HDF5 file that has no checksum and can hang its library: the heaps of long text.

Text of variable length, and the references from arrays to their dimensions, lie in *global heap collections*:
a header (``GCOL``, version, length), then objects, each with a header of 16 bytes (index, count, length) and
padded to 8 bytes; index 0 is the free rest, and its length counts the header. The library steps from object
to object without asking whether it moves: one flipped bit that makes it land on zeros, read as free space of
length 0, and it never returns. An array of text holds, an element, a length, the address of a collection and
an index; the library believes the length: one flipped bit makes it ask for gigabytes. So both are verified
here from the bytes, before the library looks.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from h5py import h5d

from .errors import FileError

_START = b"GCOL\x01\0\0\0"
_WINDOW = 1 << 18  # bytes
MOST_BYTES = 1 << 26  # of a collection
_LENGTH = struct.Struct("<Q")
_OBJECT = struct.Struct("<HHIQ")
_POINTER = np.dtype([("length", "<u4"), ("address", "<u8"), ("index", "<u4")])

Heaps = dict[int, dict[int, int]]
"""Length of each object by index, by address of its collection."""


def sound_heaps(path: str | os.PathLike[str]) -> Heaps:
    """Step through every heap collection of a file as the library would, each byte once.

    Collections never overlap: what looks like one within another, or claims bytes that are another's, is a trap.

    Raises
    ------
    FileError
        In one of them the library would stand still or leave it.
    """
    found: Heaps = {}
    end = 0
    with Path(path).open("rb") as file:
        for start in _starts(file.fileno()):
            if start < end:
                raise _damaged(start)
            end, found[start] = _objects(file.fileno(), start)
    return found


def _starts(descriptor: int) -> Iterator[int]:
    """Where collections begin; read window by window, for the pages of a map would count as memory."""
    offset, window = 0, b""
    while more := os.pread(descriptor, _WINDOW, offset + len(window)):
        window += more
        found = window.find(_START)
        while found >= 0:
            yield offset + found
            found = window.find(_START, found + 1)
        offset, window = offset + len(window) - len(_START) + 1, window[-len(_START) + 1 :]


def _damaged(start: int) -> FileError:
    return FileError(f"its text storage is damaged at byte {start}; restore it, or copy it with h5repack")


def _objects(descriptor: int, start: int) -> tuple[int, dict[int, int]]:
    """Where a collection ends, and the length of each object by index."""
    head = len(_START) + _LENGTH.size
    begun = os.pread(descriptor, head, start)
    if len(begun) < head:
        raise _damaged(start)
    (length,) = _LENGTH.unpack_from(begun, len(_START))
    if length > MOST_BYTES and start + length <= os.fstat(descriptor).st_size:
        raise FileError(f"file: more than {MOST_BYTES} bytes outside its arrays; split the file, or shorten its texts")
    data = os.pread(descriptor, min(length, MOST_BYTES), start)
    if len(data) < length or length < head:
        raise _damaged(start)
    found = {}
    position = head
    while position + _OBJECT.size <= length:
        index, _, _, size = _OBJECT.unpack_from(data, position)
        step = size if index == 0 else _OBJECT.size + -(-size // 8) * 8
        if step < _OBJECT.size or position + step > length:
            raise _damaged(start)
        if index:
            found[index] = size
        position += step
    return start + length, found


def text_bytes(path: str | os.PathLike[str], array: h5d.DatasetID, heaps: Heaps, where: str) -> int:
    """Bytes of text that an array of variable-length text points at, each pointer verified against the heaps.

    Raises
    ------
    FileError
        A pointer leads nowhere or claims more than is there, or the pointers are stored so that they cannot
        be seen.
    """
    made = array.get_create_plist()
    contiguous = made.get_layout() == h5d.CONTIGUOUS
    if made.get_nfilters() or made.get_layout() == h5d.COMPACT:
        raise FileError(f"{where}: its text is stored compressed or compact; store it plainly")
    if contiguous:
        blocks = [(array.get_offset(), array.get_storage_size())]
    else:
        chunks = (array.get_chunk_info(index) for index in range(array.get_num_chunks()))
        blocks = [(one.byte_offset, one.size) for one in chunks]
    total = 0
    with Path(path).open("rb") as file:
        for offset, size in blocks:
            if offset is None:  # declared but never written: all empty
                continue
            file.seek(offset)
            total += _pointed(file.read(size), heaps, where)
    return total


def _pointed(raw: bytes, heaps: Heaps, where: str) -> int:
    total = 0
    usable = len(raw) - len(raw) % _POINTER.itemsize
    for length, address, index in np.frombuffer(raw[:usable], dtype=_POINTER).tolist():
        if length > heaps.get(address, {}).get(index, 0):
            raise FileError(f"{where}: its text is damaged; restore the file")
        total += length
    return total
