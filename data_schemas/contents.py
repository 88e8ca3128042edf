"""The plain content of a file, without HDF5 or xarray, so that what is checked and what is summed is the same."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import FileError

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

NUMBERS = frozenset({"i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f4", "f8"})
_INSTEAD = {
    "c": "complex numbers do not travel: store amplitude and phase",
    "b": "truth values have no netCDF type: store 0 and 1 as uint8",
    "m": "time spans have no netCDF type: store seconds",
}


@dataclass
class Entry:
    """A variable: dimension names, values (numbers in native byte order, or ``str``), attributes."""

    dims: tuple[str, ...]
    values: "NDArray[Any]"
    attrs: dict[str, Any] = field(default_factory=dict)


@dataclass
class Group:
    """A group: its own attributes and variables, by name."""

    attrs: dict[str, Any] = field(default_factory=dict)
    variables: dict[str, Entry] = field(default_factory=dict)


Contents = dict[str, Group]
"""Groups by path without leading slash; the root is ``""``. ``a/b`` is inside ``a``, which is there too."""


def key(path: str, name: str) -> str:
    """``group/name``; the bare name at the root."""
    return f"{path}/{name}" if path else name


IDENTIFIER = re.compile(r"[A-Za-z0-9._+-]{1,64}")  # Of a record


def identifier(text: str) -> str:
    """Identifier of a record that reads like a text: "Ship-3-day-1" of "Ship 3, day 1", "record" of ""."""
    return re.sub(r"[^A-Za-z0-9._+-]+", "-", text).strip("-")[:64] or "record"


def shown(text: object, most: int = 80) -> str:
    """Text from a file made fit for one line of a message."""
    plain = str(text)
    if not plain.isprintable():
        plain = "".join(letter if letter.isprintable() else "?" for letter in plain)
    return plain if len(plain) <= most else plain[: most - 3] + "..."


def type_name(values: "NDArray[Any]") -> str:
    """``"f8"``, ``"u2"``, ... or ``"str"``: the name of a number type without its byte order."""
    return "str" if values.dtype.kind in "UT" else values.dtype.str[1:]


def storable_text(text: str, where: str) -> str:
    """The text itself, if a file can hold it: no NUL, no lone surrogate; otherwise `FileError`."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise FileError(f"{where}: text that is not valid Unicode cannot be stored; replace it") from None
    if "\0" in text:
        raise FileError(f"{where}: text with a NUL character cannot be stored; remove it")
    return text


def plain_values(values: "NDArray[Any]", where: str) -> "NDArray[Any]":
    """Values as a file can hold them: a number type of `NUMBERS` in native byte order, or text; else `FileError`."""
    kind = values.dtype.kind
    if kind in "OTU":
        flat = values.ravel().tolist()
        if not all(isinstance(one, str) for one in flat):
            raise FileError(f"{where}: holds objects that are neither numbers nor text; store numbers or str")
        for one in flat:
            storable_text(one, where)
        return values if kind == "U" else np.array(flat, dtype=np.str_).reshape(values.shape)
    if kind in _INSTEAD or values.dtype.str[1:] not in NUMBERS:
        remedy = _INSTEAD.get(kind, "store one of " + ", ".join(sorted(NUMBERS)))
        raise FileError(f"{where}: type {values.dtype} cannot be stored; {remedy}")
    return values if values.dtype.isnative else values.astype(values.dtype.newbyteorder("="))


def plain_attribute(value: object, where: str) -> Any:
    """An attribute as a file can hold it: str, list of str, number, or one-dimensional array of numbers.

    One element is that element: netCDF does not tell them apart. `FileError`: empty, nested, or of another type.
    """
    if isinstance(value, str):
        return storable_text(value, where)
    try:
        array = np.asarray(value)
    except (ValueError, OverflowError):
        array = np.empty(0)
    if array.ndim > 1 or array.size == 0:
        raise FileError(f"{where}: an attribute must be text, a number, or a flat list of either, not empty")
    array = plain_values(array, where)
    if array.dtype.kind == "U":
        texts: list[str] = array.ravel().tolist()
        return texts[0] if array.size == 1 else texts
    return as_attribute(array)


def as_attribute(numbers: "NDArray[Any]") -> Any:
    """Numbers of an attribute: a single one as such, int and float for Python's types; the checksum covers the type."""
    if numbers.size != 1:
        return numbers
    number = numbers.ravel()[0]
    return number.item() if type_name(numbers) in ("i8", "f8") else number


def from_tree(tree: "xr.DataTree", *, numbers: bool = False) -> Contents:
    """The content of a tree, or its `numbers` alone; arrays are not copied. `FileError`: a type no file can hold."""
    contents: Contents = {}
    for node in tree.subtree:
        path = "" if node is tree else node.relative_to(tree)
        own = node.to_dataset(inherit=False)
        kept = {str(name): one for name, one in own.variables.items() if not (numbers and one.dtype.kind in "OTU")}
        variables = {name: _entry(one, key(path, name), {} if numbers else one.attrs) for name, one in kept.items()}
        contents[path] = Group({} if numbers else _plain_attrs(own.attrs, path or "root"), variables)
    return contents


def _entry(one: "xr.Variable", where: str, attrs: Mapping[Any, Any]) -> Entry:
    """A variable; dates, as xarray decodes them, become seconds since the epoch that they were read from."""
    values = one.values
    if values.dtype.kind == "M":
        known = values[~np.isnat(values)]
        first = known.min() if known.size else np.datetime64(0, "s")
        epoch = str(one.encoding.get("units", "")).partition(" since ")[2] or f"{first.astype('datetime64[s]')}Z"
        begin = np.datetime64(epoch.strip().removesuffix("Z").removesuffix("+00:00"))
        values = (values - begin) / np.timedelta64(1, "s")
        attrs = {"units": f"seconds since {epoch}", "calendar": "standard", **attrs}
    return Entry(tuple(str(dim) for dim in one.dims), plain_values(values, where), _plain_attrs(attrs, where))


def _plain_attrs(attrs: Mapping[Any, Any], where: str) -> dict[str, Any]:
    return {str(name): plain_attribute(value, f"{where}, attribute {name}") for name, value in attrs.items()}


def to_tree(contents: Contents) -> "xr.DataTree":
    """The tree of a content; a variable named as its only dimension becomes a coordinate.

    `FileError`: dimensions of one name have different lengths within a group, or between a group and the root.
    """
    import xarray as xr

    datasets = {}
    where, remedy = "", "of one name equal"
    try:
        for path, group in contents.items():
            where = f"{path or 'root'}: "
            variables = {name: (one.dims, one.values, one.attrs) for name, one in group.variables.items()}
            datasets["/" + path] = xr.Dataset(variables, attrs=group.attrs)
        where, remedy = "", "equal in length to the root's"
        return xr.DataTree.from_dict(datasets)
    except (ValueError, KeyError) as error:
        told = shown(" ".join(str(error).split()), 160)
        raise FileError(f"{where}{told}; make dimensions {remedy}") from error
