"""Joins contents that come portion by portion into one in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .contents import Contents, Entry, Group

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Joined:
    """Portions joined along a dimension, in arrays that are made once: no more memory than the whole takes.

    Parameters
    ----------
    length : int
        Of the whole along `along`.
    along : str
        The dimension that grows, the last of every variable that has it. Variables without it, and attributes, are
        those of the last portion.

    Examples
    --------
    >>> joined = Joined(3)
    >>> for values in ([1.0, 2.0], [3.0]):
    ...     joined.append({"": Group({}, {"a": Entry(("time",), np.array(values))})})
    >>> joined.whole()[""].variables["a"].values.tolist()
    [1.0, 2.0, 3.0]
    """

    def __init__(self, length: int, along: str = "time") -> None:
        self._length, self._along = length, along
        self._done = 0
        self._arrays: dict[tuple[str, str], NDArray[Any]] = {}
        self._last: Contents = {}

    def append(self, contents: Contents) -> None:
        """Take the next portion: of the same groups, variables and types as the first."""
        begin, self._done = self._done, self._done + samples(contents, self._along)
        self._last = contents
        if begin == 0 and self._done == self._length:
            return  # it is the whole already
        for path, group in contents.items():
            for name, entry in group.variables.items():
                if self._along in entry.dims:
                    if begin == 0:
                        shape = (*entry.values.shape[:-1], self._length)
                        self._arrays[path, name] = np.empty(shape, entry.values.dtype)
                    self._arrays[path, name][..., begin : self._done] = entry.values

    def whole(self) -> Contents:
        """The joined content.

        Raises
        ------
        ValueError
            If samples are missing.
        """
        if self._done != self._length:
            raise ValueError(f"{self._done} of {self._length} samples were appended")
        return {
            path: Group(
                group.attrs,
                {
                    name: Entry(entry.dims, self._arrays.get((path, name), entry.values), entry.attrs)
                    for name, entry in group.variables.items()
                },
            )
            for path, group in self._last.items()
        }


def samples(contents: Contents, along: str) -> int:
    """Length of a content along a dimension of the root's variables."""
    lengths = (one.values.shape[one.dims.index(along)] for one in contents[""].variables.values() if along in one.dims)
    return int(next(lengths))
