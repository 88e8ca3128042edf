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

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from .contents import Contents, Entry, Group, from_tree, key, type_name

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

ATTRIBUTE = "content_sha256"
_SEED = "isochrony content 1"


class _Sum:
    """SHA-256 fed with length-prefixed items, so that no two contents give the same bytes."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self.text(_SEED)

    def text(self, *texts: str) -> None:
        for one in texts:
            data = one.encode()
            self._hash.update(len(data).to_bytes(8, "little") + data)

    def values(self, values: NDArray[Any], blocks: Iterable[NDArray[Any]] | None = None) -> None:
        """An item an element of text; of numbers one item, whose bytes may come in blocks."""
        if type_name(values) == "str":
            self.text(*values.ravel().tolist())
            return
        self._hash.update(values.nbytes.to_bytes(8, "little"))
        for block in (values,) if blocks is None else blocks:
            little = np.ascontiguousarray(block, dtype=block.dtype.newbyteorder("<"))
            self._hash.update(little.reshape(-1).view(np.uint8).data)

    def attributes(self, attrs: Mapping[str, Any]) -> None:
        for name in sorted(attrs, key=str.encode):
            values = np.atleast_1d(np.asarray(attrs[name]))
            self.text("attribute", name, type_name(values), str(values.size))
            self.values(values)

    def variable(self, name: str, entry: Entry, blocks: Iterable[NDArray[Any]] | None) -> None:
        self.text("variable", name, str(len(entry.dims)))
        for dim, size in zip(entry.dims, entry.values.shape, strict=True):
            self.text(dim, str(size))
        self.text(type_name(entry.values))
        self.values(entry.values, blocks)
        self.attributes(entry.attrs)

    def hexdigest(self) -> str:
        return self._hash.hexdigest()


def digest(contents: Contents, blocks: Mapping[str, Iterable[NDArray[Any]]] = MappingProxyType({})) -> str:
    """The checksum of a plain content, 64 hexadecimal digits (definition: see the module).

    Parameters
    ----------
    contents : Contents
    blocks : mapping of str to iterable of array, optional
        Numbers of variables (``group/name``) that are too many to be held: in blocks, last dimension fastest. Of such
        a variable's own values only shape and type are looked at.
    """
    total = _Sum()
    for path in sorted(contents, key=str.encode):
        group = contents[path]
        total.text("group", path)
        total.attributes({n: v for n, v in group.attrs.items() if path or n != ATTRIBUTE})
        for name in sorted(group.variables, key=str.encode):
            total.variable(name, group.variables[name], blocks.get(key(path, name)))
    return total.hexdigest()


def numbers_sha256(tree: xr.DataTree) -> str:
    """The checksum of a tree's numbers alone, but for the times that were taken: the same where a run is repeated."""

    def counts(name: str, entry: Entry) -> bool:
        return name != "elapsed" and type_name(entry.values) != "str"

    plain = {
        path: {name: Entry(one.dims, one.values) for name, one in group.variables.items() if counts(name, one)}
        for path, group in from_tree(tree).items()
    }
    return digest({path: Group({}, variables) for path, variables in plain.items()})


def content_sha256(tree: xr.DataTree) -> str:
    """The checksum of a tree in memory: the same as in the file it was read from, or will be written to.

    Raises
    ------
    FileError
        A variable or attribute has a type that no file can hold.
    """
    return digest(from_tree(tree))
