"""Large files without their values in memory: looked over and verified slab by slab."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from h5py import h5d

from .checksum import ATTRIBUTE, digest
from .contents import Contents, shown
from .errors import FileError
from .guard_types import Budget
from .reading import opened

if TYPE_CHECKING:
    from numpy.typing import NDArray

SLAB = 1 << 16
"""Elements read at once."""

Place = tuple[int | slice, ...]


def slabs(shape: tuple[int, ...], most: int = SLAB) -> Iterator[Place]:
    """Index expressions that cover an array in order, last dimension fastest, of at most `most` elements each.

    Examples
    --------
    >>> list(slabs((2, 5), 3))
    [(0, slice(0, 3, None)), (0, slice(3, 6, None)), (1, slice(0, 3, None)), (1, slice(3, 6, None))]
    >>> list(slabs((5, 2), 4)), list(slabs(()))
    ([(slice(0, 2, None),), (slice(2, 4, None),), (slice(4, 6, None),)], [()])
    """
    inner = math.prod(shape[1:])
    if not shape:
        yield ()
    elif inner > most:
        for index in range(shape[0]):
            for rest in slabs(shape[1:], most):
                yield (index, *rest)
    else:
        step = most // max(inner, 1)
        for begin in range(0, shape[0], step):
            yield (slice(begin, begin + step),)


def skim(path: str | os.PathLike[str]) -> tuple[Contents, str]:
    """Look a file over and sum it up in bounded memory.

    Returns
    -------
    contents : Contents
        As stored, ``content_sha256`` left out; of arrays of numbers shape and type only, their values are worth
        nothing.
    digest : str
        The checksum of what is stored.

    Raises
    ------
    FileError
        The file is missing, damaged or hostile, or does not match its checksum.
    """
    arrays: dict[str, h5d.DatasetID] = {}

    def shape_only(array: h5d.DatasetID, where: str) -> NDArray[Any]:
        arrays[where] = array
        return np.broadcast_to(np.zeros((), array.get_type().dtype.newbyteorder("=")), array.shape)

    def blocks(array: h5d.DatasetID) -> Iterator[NDArray[Any]]:
        stored = h5py.Dataset(array)
        return (np.asarray(stored[place]) for place in slabs(array.shape))

    with opened(path, Budget()) as contents_by:
        contents = contents_by(shape_only)
        stored = contents[""].attrs.pop(ATTRIBUTE, None)
        found = digest(contents, {where: blocks(array) for where, array in arrays.items()})
    if stored not in (None, found):
        raise FileError(f"{shown(path, 400)}: {ATTRIBUTE} does not match the content, the file was damaged or edited")
    return contents, found
