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
import re
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from h5py import h5d

from .errors import FileError

_MARK = re.compile(rb"GCOL\x01\0{3}(?!.[\0-\x0f]\0{6})", re.DOTALL)
"""Begins a collection; of less than 4096 bytes the library itself refuses it."""
_HEAD = 16  # bytes of a collection's own
_WINDOW = 1 << 18  # bytes
MOST_BYTES, MOST_OBJECTS = 1 << 26, 1 << 19  # of all collections
MOST_POINTERS = 1 << 20  # bytes of an array of pointers
_LENGTH = struct.Struct("<Q")
_OBJECT = struct.Struct("<HHIQ")
_POINTER = np.dtype([("length", "<u4"), ("address", "<u8"), ("index", "<u4")])

Heaps = dict[int, dict[int, int]]  # Length of each object by index, by address of its collection


def sound_heaps(path: str | os.PathLike[str]) -> Heaps:
    """Step through every heap collection of a file as the library would, each byte once.

    Collections never overlap: what looks like one within another, or claims bytes that are another's, is a trap.
    `FileError`: in one of them the library would stand still or leave it, or they are larger than any text is.
    """
    found: Heaps = {}
    end = total = objects = 0
    with Path(path).open("rb") as file:
        for start in _starts(file.fileno()):
            if start < end:
                raise _damaged(start)
            data = _collection(file.fileno(), start, MOST_BYTES - total)
            found[start] = _objects(data, start)
            end, total, objects = start + len(data), total + len(data), objects + len(found[start])
            if objects > MOST_OBJECTS:
                raise FileError(f"file: more than {MOST_OBJECTS} texts; split the file, or join its texts")
    return found


def _starts(descriptor: int) -> Iterator[int]:
    """Where collections begin; read window by window, for the pages of a map would count as memory."""
    offset, window, more = 0, b"", b"more"
    while more:
        more = os.pread(descriptor, _WINDOW, offset + len(window))
        window += more
        whole = max(0, len(window) - _HEAD + 1) if more else len(window)  # of the others more must be seen
        yield from (offset + mark.start() for mark in _MARK.finditer(window) if mark.start() < whole)
        offset, window = offset + whole, window[whole:]


def _damaged(start: int) -> FileError:
    return FileError(f"its text storage is damaged at byte {start}; restore it, or copy it with h5repack")


def _collection(descriptor: int, start: int, most: int) -> bytes:
    """Bytes of the collection that begins at a place."""
    begun = os.pread(descriptor, _HEAD, start)
    if len(begun) < _HEAD:
        raise _damaged(start)
    (length,) = _LENGTH.unpack_from(begun, _HEAD - _LENGTH.size)
    if start + length > os.fstat(descriptor).st_size:
        raise _damaged(start)
    if length > most:
        raise FileError(f"file: more than {MOST_BYTES} bytes outside its arrays; split the file, or shorten its texts")
    return os.pread(descriptor, length, start)  # of a file that is cut meanwhile less: its steps leave it


def _objects(data: bytes, start: int) -> dict[int, int]:
    """Length of each object of a collection by index."""
    found, position, length = {}, _HEAD, len(data)
    while position + _OBJECT.size <= length:
        index, _, _, size = _OBJECT.unpack_from(data, position)
        step = size if index == 0 else _OBJECT.size + -(-size // 8) * 8
        if step < _OBJECT.size or position + step > length:
            raise _damaged(start)
        if index:
            found[index] = size
        position += step
    return found


def text_bytes(path: str | os.PathLike[str], array: h5d.DatasetID, heaps: Heaps, where: str) -> int:
    """Bytes of text that an array of variable-length text points at, each pointer verified against the heaps.

    `FileError`: a pointer leads nowhere or claims more than is there, or pointers are stored so that nobody sees them.
    """
    made = array.get_create_plist()
    contiguous = made.get_layout() == h5d.CONTIGUOUS
    if made.get_nfilters() or made.get_layout() == h5d.COMPACT:
        raise FileError(f"{where}: its text is stored compressed or compact; store it plainly")
    if contiguous:
        blocks = [(array.get_offset(), array.get_storage_size())]
    else:
        blocks = []
        array.chunk_iter(lambda one: blocks.append((one.byte_offset, one.size)))
    if sum(size for _, size in blocks) > MOST_POINTERS:
        raise FileError(f"{where}: has more than {MOST_POINTERS} bytes of pointers to text; use fewer chunks")
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
