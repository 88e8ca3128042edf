"""Looks a file over before anything in it is read, and refuses what could deceive, exhaust or hang the reader.

Only an ordinary HDF5 file passes, made of hard-linked groups and arrays of plain numbers or text, stored inside the
file itself, within a `Budget`. Nothing here follows a link or touches values: it is safe in the caller's own process.

The heaps of long text have no checksum and can hang the library, so they are verified from the bytes before it looks.
A *global heap collection* is a header (``GCOL``, version, length), then objects, each with a header of 16 bytes
(index, count, length) and padded to 8 bytes; index 0 is the free rest, and its length counts the header. The library
steps from object to object without asking whether it moves: a flipped bit may make it land on zeros, and it never
returns. An array of text holds, an element, a length, the address of a collection and an index; the library believes
the length: one flipped bit makes it ask for gigabytes.
"""

import math
import os
import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
from h5py import h5a, h5d, h5g, h5l, h5o, h5s, h5t, h5z

from .contents import NUMBERS, key, shown
from .errors import FileError
from .text_files import ordinary_size

SIGNATURE = b"\x89HDF\r\n\x1a\n"
BOOKKEEPING = frozenset(
    b"DIMENSION_LIST REFERENCE_LIST DIMENSION_LABELS CLASS NAME _Netcdf4Dimid _Netcdf4Coordinates _nc3_strict"
    b" _NCProperties".split()
)  # Attributes by which HDF5 and netCDF-4 tie arrays to their dimensions; never part of the content

_LAYOUTS = frozenset({h5d.COMPACT, h5d.CONTIGUOUS, h5d.CHUNKED})
_FILTERS = frozenset({h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32})
_MIB = 1 << 20

_MARK = re.compile(rb"GCOL\x01\0{3}(?!.[\0-\x0f]\0{6})", re.DOTALL)
"""Begins a collection; of less than 4096 bytes the library itself refuses it."""
_HEAD = 16  # bytes of a collection's own
_WINDOW = 1 << 18  # bytes
MOST_BYTES, MOST_OBJECTS = 1 << 26, 1 << 19  # of all collections
MOST_POINTERS = 1 << 20  # bytes of an array of pointers
_OBJECT = struct.Struct("<HHIQ")
_POINTER = np.dtype([("length", "<u4"), ("address", "<u8"), ("index", "<u4")])

Heaps = dict[int, dict[int, int]]  # Length of each object by index, by address of its collection


@dataclass(frozen=True)
class Budget:
    """What one file may declare at most; the largest honest one, a day's result at 100 Hz by all methods, has 2.5 GiB.

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


class Found(NamedTuple):
    """A group or an array that passed."""

    path: str  # of the group, without leading slash; for an array that of its group
    name: str  # of the array; empty for a group
    id: h5g.GroupID | h5d.DatasetID
    attributes: dict[str, h5a.AttrID]  # that passed; bookkeeping left out
    address: int  # of its header in the file; references point there


@dataclass
class Survey:
    """Everything that passed, in the file's order, and what it may take."""

    budget: Budget
    groups: list[Found] = field(default_factory=list)
    arrays: list[Found] = field(default_factory=list)
    declared: int = 0  # bytes of all values, unpacked
    heap: int = 0  # bytes that the rest of the file can hold of text at most
    text: int = 0  # bytes of text that were read


def ordinary(path: str | os.PathLike[str], most: int = Budget().file) -> int:
    """Size of an ordinary file of at most so many bytes that starts like HDF5; `FileError` for anything else."""
    size = ordinary_size(path, most, "give a netCDF-4 file, made with simulate or import")
    try:
        with Path(path).open("rb") as file:
            start = file.read(len(SIGNATURE))
    except OSError as error:
        raise FileError(f"{shown(path, 400)}: {error.strerror}; make the file readable") from None
    if start != SIGNATURE:
        remedy = "make it with simulate or import, or save it as netCDF-4"
        raise FileError(f"{shown(path, 400)}: is not netCDF-4 (HDF5); {remedy}")
    return size


def survey(file: h5py.File, size: int, budget: Budget) -> Survey:
    """Walk over an open file of `size` bytes; `FileError`, without the file's name, if anything in it is not plain."""
    found = Survey(budget)
    stored = 0
    root = h5g.open(file.id, b"/")
    waiting = [("", root, 0, h5o.get_info(root).addr)]
    seen = {waiting[0][-1]}
    while waiting:
        path, group, depth, address = waiting.pop(0)
        found.groups.append(Found(path, "", group, _attributes(group, path or "root", budget), address))
        _within(len(found.groups), budget.groups, path, "groups")
        for name, child, address in _children(group, path, budget):
            where = key(path, name)
            if address in seen:
                raise FileError(f"{where}: is linked from two places; store each group and variable once")
            seen.add(address)
            if isinstance(child, h5g.GroupID):
                _within(depth + 1, budget.depth, where, "levels of groups")
                waiting.append((where, child, depth + 1, address))
                continue
            if not isinstance(child, h5d.DatasetID):
                raise FileError(f"{where}: is a user-defined type, which no schema uses; remove it")
            found.declared += _declared(child, where, budget)
            stored += child.get_storage_size()
            _within(found.declared, budget.bytes, where, "bytes of values")
            found.arrays.append(Found(path, name, child, _attributes(child, where, budget), address))
            _within(len(found.arrays), budget.arrays, where, "variables")
    if found.declared > budget.always + budget.packed * size:
        remedy = "hardly a measurement; split it, or write it less compressed"
        raise FileError(f"declares {found.declared >> 20} MiB of values in {size} bytes, {remedy}")
    found.heap = max(size - stored, 0)
    _within(found.heap, budget.heap, "file", "bytes outside its arrays")
    return found


def _within(count: int, most: int, where: str, what: str) -> None:
    if count > most:
        raise FileError(f"{where or 'root'}: more than {most} {what}; split the file or remove what no schema uses")


def _children(group: h5g.GroupID, path: str, budget: Budget) -> Iterator[tuple[str, object, int]]:
    """Name, member and its address in the file."""
    _within(group.get_num_objs(), budget.links, path, "members in one group")
    links: dict[bytes, tuple[int, int]] = {}
    group.links.iterate(lambda raw, link: links.update({raw: (link.type, link.u)}), info=True)
    for raw in list(group):  # in the order in which they were made
        kind, address = links[raw]
        name = raw.decode("utf-8", "replace")
        where = key(path, shown(name))
        if kind != h5l.TYPE_HARD:
            raise FileError(f"{where}: is a soft or external link; copy what it points to into the file")
        if not name.isprintable() or "�" in name:
            raise FileError(f"{where}: name holds characters that do not print; rename it")
        yield name, h5o.open(group, raw), address


def _declared(array: h5d.DatasetID, where: str, budget: Budget) -> int:
    """Bytes that the array declares, if it is plain data inside the file."""
    space, made = array.get_space(), array.get_create_plist()
    if space.get_simple_extent_type() == h5s.NULL:
        raise FileError(f"{where}: has no values at all; write it again")
    layout = made.get_layout()
    if layout not in _LAYOUTS or made.get_external_count():
        raise FileError(f"{where}: its values lie outside the file (external or virtual); copy them into it")
    filters = {made.get_filter(index)[0] for index in range(made.get_nfilters())}
    if not filters <= _FILTERS:
        raise FileError(f"{where}: uses an unknown filter; write it with deflate, shuffle or fletcher32 only")
    kind, shape = _plain(array.get_type(), where), space.shape
    _within(len(shape), budget.rank, where, "dimensions")
    elements = math.prod(shape)
    if is_text(kind):
        _within(elements, budget.texts, where, "texts")
    size: int = elements * kind.get_size()
    if layout == h5d.CHUNKED:
        chunk = made.get_chunk()
        _within(math.prod(chunk) * kind.get_size(), budget.chunk, where, "bytes in a chunk")
        _within(math.prod(-(-n // step) for n, step in zip(shape, chunk, strict=True)), budget.chunks, where, "chunks")
    if h5z.FILTER_DEFLATE not in filters:
        # nothing compressed: what is declared must be there, or the reader would be filled with nothing
        _within(size - array.get_storage_size(), budget.unwritten, where, "bytes declared but never written")
    return size


def full_chunks(array: h5d.DatasetID) -> None:
    """Raise where a chunk does not unpack to its size: HDF5 reads on beyond it, or unpacks whatever there is."""
    made, kind = array.get_create_plist(), array.get_type()
    filters = [(index, made.get_filter(index)[0]) for index in reversed(range(made.get_nfilters()))]
    if not filters or (is_text(kind) and kind.is_variable_str()):
        return
    size = math.prod(made.get_chunk()) * kind.get_size()
    most = size + size // 500 + 64  # bytes of a chunk of noise, which deflate makes longer
    chunks: list[h5d.StoreInfo] = []
    array.chunk_iter(chunks.append)
    for chunk in chunks:
        data = array.read_direct_chunk(chunk.chunk_offset)[1] if chunk.size <= most else b""
        for index, one in filters:
            if one == h5z.FILTER_DEFLATE and not chunk.filter_mask >> index & 1:
                data = zlib.decompressobj().decompress(data, most)
            elif one == h5z.FILTER_FLETCHER32 and not chunk.filter_mask >> index & 1:
                data = data[:-4]
        if len(data) != size:
            raise ValueError(f"a chunk of {len(data)} bytes instead of {size}")


def is_text(kind: h5t.TypeID) -> bool:
    """Whether an HDF5 type is text, of fixed or variable length."""
    return bool(kind.get_class() == h5t.STRING)


def _plain(kind: h5t.TypeID, where: str) -> h5t.TypeID:
    """The type itself, if it is one of the plain numbers or text."""
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


def _attributes(owner: h5g.GroupID | h5d.DatasetID, where: str, budget: Budget) -> dict[str, h5a.AttrID]:
    _within(h5a.get_num_attrs(owner), budget.attributes, where, "attributes")
    names: list[bytes] = []
    h5a.iterate(owner, names.append)
    passed = {}
    for raw in names:
        if raw in BOOKKEEPING:
            continue
        attribute = h5a.open(owner, raw)
        name = raw.decode("utf-8", "replace")
        told = f"{where}, attribute {shown(name)}"
        kind, space = _plain(attribute.get_type(), told), attribute.get_space()
        _within(space.get_simple_extent_ndims(), 1, told, "dimensions")
        elements = space.get_simple_extent_npoints()
        _within(elements, budget.attribute_elements, told, "elements")
        _within(elements * kind.get_size(), budget.attribute_bytes, told, "bytes")
        passed[name] = attribute
    return passed


def sound_heaps(path: str | os.PathLike[str]) -> Heaps:
    """Step through every heap collection as the library would, each byte once; overlaps are traps.

    `FileError`: in one of them the library would stand still or leave it, or they are larger than any text is.
    """
    found: Heaps = {}
    end = total = objects = 0
    with Path(path).open("rb") as file:
        descriptor = file.fileno()
        for start in _starts(descriptor):
            length = int.from_bytes(os.pread(descriptor, _HEAD, start)[8:], "little")
            if start < end or length < _HEAD or start + length > os.fstat(descriptor).st_size:
                raise _damaged(start)
            if total + length > MOST_BYTES:
                remedy = "split the file, or shorten its texts"
                raise FileError(f"file: more than {MOST_BYTES} bytes outside its arrays; {remedy}")
            data = os.pread(descriptor, length, start)  # of a file that is cut meanwhile less: its steps leave it
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
    made, blocks = array.get_create_plist(), list[tuple[int | None, int]]()
    if made.get_nfilters() or made.get_layout() == h5d.COMPACT:
        raise FileError(f"{where}: its text is stored compressed or compact; store it plainly")
    if made.get_layout() == h5d.CONTIGUOUS:
        blocks.append((array.get_offset(), array.get_storage_size()))
    else:
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
    pointers = np.frombuffer(raw, dtype=_POINTER, count=len(raw) // _POINTER.itemsize)
    for length, address, index in pointers.tolist():
        if length > heaps.get(address, {}).get(index, 0):
            raise FileError(f"{where}: its text is damaged; restore the file")
    return int(pointers["length"].sum(dtype=np.int64))
