"""What a file may declare at most, and which HDF5 types are plain numbers or text."""

from __future__ import annotations

from dataclasses import dataclass

from h5py import h5t

from .contents import NUMBERS
from .errors import FileError

_MIB = 1 << 20


@dataclass(frozen=True)
class Budget:
    """Limits of one file.

    The largest honest file is the result of a day at 100 Hz by all methods: 2.5 GiB; the others are far smaller.
    Values may take `always` bytes and `packed` times those of their file. `chunks` allows an unlimited dimension
    written a sample at a time for half a day at 25 Hz.
    """

    file: int = 5120 * _MIB
    bytes: int = 4096 * _MIB
    packed: int = 50
    always: int = 256 * _MIB
    unwritten: int = 64 * _MIB
    heap: int = 64 * _MIB
    chunk: int = 256 * _MIB
    chunks: int = 1 << 20
    rank: int = 8
    texts: int = 10_000
    text_bytes: int = 64 * _MIB
    attributes: int = 256
    attribute_elements: int = 1024
    attribute_bytes: int = 4 * _MIB
    groups: int = 64
    depth: int = 8
    links: int = 512
    arrays: int = 1024


def is_text(kind: h5t.TypeID) -> bool:
    """Whether an HDF5 type is text, of fixed or variable length."""
    return bool(kind.get_class() == h5t.STRING)


def plain_type(kind: h5t.TypeID, where: str) -> h5t.TypeID:
    """The type itself, if it is one of the plain numbers or text.

    Raises
    ------
    FileError
        It is compound, enumerated, opaque, a reference, an array, a variable-length list, or an odd number
        format.
    """
    if is_text(kind):
        return kind
    if kind.get_class() in (h5t.INTEGER, h5t.FLOAT):
        try:
            if kind.dtype.str[1:] in NUMBERS:
                return kind
        except (TypeError, ValueError):  # a bit layout that numpy does not have
            pass
    allowed = ", ".join(sorted(NUMBERS))
    raise FileError(f"{where}: its type is neither a plain number nor text; store one of {allowed}, or str")
