"""The faults a user can mend: each carries one line that names the file, the variable and the remedy."""

import os


class IsochronyError(Exception):
    """A fault with a remedy; `exit_status` is what the command line returns for it."""

    exit_status = 3


class UsageError(IsochronyError):
    """An option, a configuration or a scene that cannot be meant (exit status 2)."""

    exit_status = 2


class SceneError(UsageError):
    """A scene that cannot be simulated (exit status 2)."""


class FileError(IsochronyError):
    """A file that cannot be read or written: not there, not HDF5, truncated, hostile, damaged."""


class RecordError(IsochronyError):
    """A record whose content cannot be used; the message names variable and remedy."""


class RefusedError(IsochronyError):
    """A method declines a record it would get wrong; the message says why and what to use instead."""


def naming(path: str | os.PathLike[str], message: str) -> str:
    """Put the file before the message, "a/ship.nc: truncated; copy it again", unless the message names it already."""
    path = os.fspath(path)
    return message if os.path.basename(path) in message else f"{path}: {message}"
