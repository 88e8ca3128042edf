"""What a result was made from, with what."""

import functools
import json
import platform
import sys
from importlib import metadata

_PACKAGES = ("isochrony", "numpy", "scipy", "numba", "h5py", "h5netcdf", "xarray", "boule")


@functools.cache
def versions() -> str:
    """Versions of the packages that make the numbers, as JSON."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "not installed"
    return json.dumps(found, sort_keys=True)


def command_line() -> str:
    """The words of this process, as text that a file can hold: what is no UTF-8, as in some names, is escaped."""
    words = " ".join(sys.argv) if sys.argv and sys.argv[0] else "python"
    return words.encode("utf-8", "backslashreplace").decode()
