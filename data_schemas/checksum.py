"""The checksum of a content: one SHA-256 over every name, dimension, type, value and attribute.

Definition (``content_sha256``, version 1). The digest is SHA-256 over a sequence of *items*. An item is its length in
bytes as an unsigned 64-bit little-endian integer, then the bytes; text is UTF-8. In this order:

1. the text ``isochrony content 1``;
2. for each group, sorted by path (the root is the empty path; no leading slash): the text ``group``, the path, the
   group's attributes, then its variables;
3. for each variable, sorted by name: the text ``variable``, the name, the number of dimensions as text, then for each
   its name and its length as text; the type (``f8``, ``u2``, ..., ``str``); the values; the variable's attributes;
4. for each attribute, sorted by name: the text ``attribute``, the name, the type, the number of elements as text, the
   values. The root's attribute ``content_sha256`` itself is left out.

Values are one item for numbers (all elements, last dimension fastest, little-endian, the bits as they are: -0.0 and
the payload of a NaN count) and one item an element for text. Sorting is by UTF-8 bytes. Nothing of HDF5 enters: chunks,
filters, byte order on disk, order of attributes and the netCDF-4 bookkeeping attributes do not change the digest.
"""

import hashlib
import itertools
import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .contents import Contents, from_tree, type_name

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

ATTRIBUTE = "content_sha256"
SLAB = 1 << 16  # Elements of an array of a file that are read at once


def slabs(shape: tuple[int, ...], most: int = SLAB) -> Iterator[tuple[int | slice, ...]]:
    """Index expressions that cover an array in order, last dimension fastest, of at most `most` elements each."""
    inner = math.prod(shape[1:])
    if not shape:
        yield ()
    elif inner > most:
        yield from ((index, *rest) for index in range(shape[0]) for rest in slabs(shape[1:], most))
    else:
        step = most // max(inner, 1)
        yield from ((slice(begin, begin + step),) for begin in range(0, shape[0], step))


def digest(contents: Contents) -> str:
    """The checksum of a plain content, 64 hexadecimal digits; an array of an open file is read block by block."""
    total = hashlib.sha256()

    def put_text(*texts: str) -> None:
        for one in texts:
            data = one.encode()
            total.update(len(data).to_bytes(8, "little") + data)

    def put_values(values: "NDArray[Any]") -> None:
        if type_name(values) == "str":
            put_text(*values.ravel().tolist())
            return
        total.update(values.nbytes.to_bytes(8, "little"))
        for place in (...,) if isinstance(values, np.ndarray) else slabs(values.shape):
            little = np.ascontiguousarray(values[place], dtype=values.dtype.newbyteorder("<"))
            total.update(little.reshape(-1).view(np.uint8).data)

    def put_attributes(attrs: Mapping[str, Any]) -> None:
        for name in sorted(attrs, key=str.encode):
            values = np.atleast_1d(np.asarray(attrs[name]))
            put_text("attribute", name, type_name(values), str(values.size))
            put_values(values)

    put_text("isochrony content 1")
    for path in sorted(contents, key=str.encode):
        group = contents[path]
        put_text("group", path)
        put_attributes({n: v for n, v in group.attrs.items() if path or n != ATTRIBUTE})
        for name in sorted(group.variables, key=str.encode):
            entry = group.variables[name]
            sizes = (str(size) for size in entry.values.shape)
            shape = itertools.chain.from_iterable(zip(entry.dims, sizes, strict=True))
            put_text("variable", name, str(len(entry.dims)), *shape, type_name(entry.values))
            put_values(entry.values)
            put_attributes(entry.attrs)
    return total.hexdigest()


def numbers_sha256(tree: "xr.DataTree") -> str:
    """The checksum of a tree's numbers alone, but for the times that were taken: the same where a run is repeated."""
    contents = from_tree(tree, numbers=True)
    for group in contents.values():
        group.variables.pop("elapsed", None)
    return digest(contents)


def content_sha256(tree: "xr.DataTree") -> str:
    """The checksum of a tree in memory, as in its file; `FileError`: a type that no file can hold."""
    return digest(from_tree(tree))
