"""Finds the dimension names of the arrays in a netCDF-4 file.

netCDF-4 keeps them as references from each array to *dimension scales*: arrays that bear the dimension's
name, whether they hold coordinates or are mere placeholders. Files of plain HDF5 have none; then the table of
variables gives the names by position, and failing that ``phony_dim_N`` by length, as netCDF does.
"""

from __future__ import annotations

from dataclasses import dataclass

import h5py
import numpy as np
from h5py import h5a, h5r, h5s, h5t

from .contents import key
from .encoding import NOT_COORDINATE, PLACEHOLDER
from .guard import Found, Survey
from .variables import VARIABLES

_REFERENCES = h5t.vlen_create(h5t.STD_REF_OBJ).encode()  # HDF5 also takes kinds of list that do not exist
_LISTS = h5py.vlen_dtype(h5py.ref_dtype)


@dataclass(frozen=True)
class Named:
    """An array with the name and the dimensions it has for the user."""

    array: Found
    name: str
    dims: tuple[str, ...]


def named(survey: Survey) -> list[Named]:
    """Every array that is a variable (placeholders are not), with its dimension names."""
    scales = {one.address: one for one in survey.arrays if _fixed_text(one, b"CLASS") == b"DIMENSION_SCALE"}
    phony: dict[tuple[str, int, int], str] = {}
    variables = []
    for one in survey.arrays:
        scale = one.address in scales
        if scale and _fixed_text(one, b"NAME").startswith(PLACEHOLDER.encode()):
            continue
        name = one.name.removeprefix(NOT_COORDINATE)
        rank = len(one.id.shape)
        dims = (name,) if scale and rank == 1 else _attached(one, rank, scales)
        variables.append(Named(one, name, dims or _by_position(one, name, rank, phony)))
    return variables


def _attached(one: Found, rank: int, scales: dict[int, Found]) -> tuple[str, ...] | None:
    """Names of the scales that the array refers to; None unless each dimension has one of the file's own."""
    if rank == 0 or not h5a.exists(one.id, b"DIMENSION_LIST"):
        return None
    attribute = h5a.open(one.id, b"DIMENSION_LIST")
    if attribute.get_space().shape != (rank,) or attribute.get_type().encode() != _REFERENCES:
        return None
    references = np.empty(rank, dtype=_LISTS)
    attribute.read(references)
    names = []
    for dimension, listed in enumerate(references):
        if not len(listed) or not listed[0]:
            return None
        scale = scales.get(h5py.h5o.get_info(h5r.dereference(listed[0], one.id)).addr)
        if scale is None or scale.id.shape != (one.id.shape[dimension],):
            return None
        names.append(scale.name)
    return tuple(names) if len(set(names)) == rank else None


def _by_position(one: Found, name: str, rank: int, phony: dict[tuple[str, int, int], str]) -> tuple[str, ...]:
    row = VARIABLES.get(key(one.path, name))
    if row is not None:
        for dims in (row.dims, *row.also):
            if len(dims) == rank:
                return dims
    places = [(one.path, length, one.id.shape[:axis].count(length)) for axis, length in enumerate(one.id.shape)]
    return tuple(phony.setdefault(place, f"phony_dim_{len(phony)}") for place in places)


def _fixed_text(one: Found, name: bytes) -> bytes:
    """A short bookkeeping text of fixed length; empty if there is none."""
    if not h5a.exists(one.id, name):
        return b""
    attribute = h5a.open(one.id, name)
    kind = attribute.get_type()
    scalar = attribute.get_space().get_simple_extent_type() == h5s.SCALAR
    if not scalar or kind.get_class() != h5t.STRING or kind.is_variable_str() or kind.get_size() > 256:
        return b""
    text = np.empty((), dtype=f"S{kind.get_size()}")
    attribute.read(text)
    return bytes(text[()])
