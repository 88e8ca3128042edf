"""Long arrays without the memory: they lie in nameless files, and are gone through portion by portion.

A record of days is small on a disk and large in memory, above all its many intermediates. So an array above `LONG`
elements is made by `room` in a scratch file that is mapped into memory: for numpy, Numba and xarray it is an array
like any other. What keeps the process small is `portions`: whoever goes through such arrays by its slices has the
pages of one portion in memory, the others are given back. Code that knows nothing of it works as before, and takes
the memory that it always took.

The file has no name and goes with the last view of its array, whatever ends the process. It lies in the folder of
`tempfile.gettempdir()` (TMPDIR); where that is memory in truth (tmpfs), nothing is gained for the machine. Its room on
the disk is reserved at once, for a write to a mapped file that has none would end the process; where the disk, the
system or the limits of the process do not grant it, the array is an ordinary one. The numbers are the same either way.
"""

from __future__ import annotations

import contextlib
import math
import mmap
import os
import tempfile
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import DTypeLike, NDArray

LONG = 1 << 18
"""Elements above which an array lies in a file: three hours of a trace at 25 Hz, 2 MiB of float64."""
PORTION = 1 << 16
"""Elements of a portion: half a MiB of float64, a chunk of our own files."""
SHARE = 4  # of the disk's free room that one array may take at most: a quarter


def room(shape: int | tuple[int, ...], dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """An array for values to come; above `LONG` elements in a scratch file.

    Parameters
    ----------
    shape : int or tuple of int
    dtype : dtype
        Of numbers.

    Returns
    -------
    array
        Its values are not set.
    """
    kind = np.dtype(dtype)
    count = math.prod(shape) if isinstance(shape, tuple) else shape
    mapped = _mapped(count * kind.itemsize) if count > LONG else None
    if mapped is None:
        return np.empty(shape, kind)
    return np.frombuffer(mapped, kind).reshape(shape)


def _mapped(size: int) -> mmap.mmap | None:
    """So many bytes of a nameless file, reserved on the disk; None where there is no room for them."""
    if not hasattr(os, "posix_fallocate"):
        return None
    with contextlib.suppress(OSError, ValueError), tempfile.TemporaryFile(prefix=".isochrony-") as file:
        disk = os.fstatvfs(file.fileno())
        if SHARE * size > disk.f_bavail * disk.f_frsize:
            return None
        os.ftruncate(file.fileno(), size)
        mapped = mmap.mmap(file.fileno(), size)  # before the disk is asked: a limit of the process shows here
        os.posix_fallocate(file.fileno(), 0, size)
        return mapped
    return None


def mapping(array: NDArray[Any]) -> mmap.mmap | None:
    """The mapped file that an array, or what it is a view of, lies in; None for one in memory."""
    base: Any = array
    while base is not None and not isinstance(base, mmap.mmap):
        base = base.obj if isinstance(base, memoryview) else getattr(base, "base", None)
    return base


def release(*arrays: NDArray[Any]) -> None:
    """Give the memory of arrays in scratch files back; their values stay, in the files."""
    for array in arrays:
        mapped = mapping(array)
        if mapped is not None:
            mapped.madvise(mmap.MADV_DONTNEED)


def portions(count: int, *arrays: NDArray[Any], unit: int = 1) -> Iterator[slice]:
    """Slices that cover so many elements in order; after each the arrays' memory is given back.

    Parameters
    ----------
    count : int
    *arrays : arrays
        What is read and written by these slices.
    unit : int
        Portions begin at multiples of it.

    Examples
    --------
    >>> list(portions(100_000))
    [slice(0, 65536, None), slice(65536, 100000, None)]
    >>> list(portions(100_000, unit=100))
    [slice(0, 65500, None), slice(65500, 100000, None)]
    """
    step = unit * max(1, PORTION // unit)
    for begin in range(0, count, step):
        try:
            yield slice(begin, min(begin + step, count))
        finally:  # also where whoever goes through has seen enough
            release(*arrays)


def by_portions(function: Callable[..., NDArray[Any]], *arrays: NDArray[Any]) -> NDArray[Any]:
    """`function(*arrays)` of arrays of one length, element by element, made portion by portion.

    Examples
    --------
    >>> by_portions(lambda a, b: a - b, np.array([3.0, 5.0]), np.array([1.0, 1.0])).tolist()
    [2.0, 4.0]
    """
    if arrays[0].size <= PORTION:
        return function(*arrays)
    out = room(arrays[0].size)
    for part in portions(out.size, out, *arrays):
        out[part] = function(*(array[part] for array in arrays))
    return out
