"""Faults told to the user: the line always names the file it is about."""

from __future__ import annotations

import os


def naming(path: str | os.PathLike[str], message: str) -> str:
    """Put the file before the message unless the message names it already.

    >>> naming("a/ship.nc", "record/elongation has no finite value; record again")
    'a/ship.nc: record/elongation has no finite value; record again'
    >>> naming("a/ship.nc", "ship.nc: truncated; copy it again")
    'ship.nc: truncated; copy it again'
    """
    path = os.fspath(path)
    return message if os.path.basename(path) in message else f"{path}: {message}"
