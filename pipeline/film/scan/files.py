"""Which kind of image a file is, told by its first bytes and never by its name."""

from __future__ import annotations

import hashlib
import importlib.util
import io
from pathlib import Path

from data_schemas.errors import FileError, UsageError
from data_schemas.ordinary import ordinary_size
from pipeline.film.scan.image import ImageFile

MOST_BYTES = 1 << 35
REMEDY = "give a scan of a film as TIFF, PNG or JPEG"
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8\xff"


def open_image(path: Path) -> ImageFile:
    """Open an image file of any kind that is known.

    Raises
    ------
    FileError
        It cannot be read, is no image, or is damaged.
    UsageError
        What reads images is not installed.
    """
    with open_binary(path) as stream:
        magic = stream.read(8)
    for needed in ("tifffile", "PIL"):
        if importlib.util.find_spec(needed) is None:
            raise UsageError(f"reading films needs {needed}, which is not installed; pip install 'isochrony[film]'")
    if magic[:4] in _TIFF:
        from pipeline.film.scan.tiff import open_tiff

        return open_tiff(path)
    if magic == _PNG or magic[:3] == _JPEG:
        from pipeline.film.scan.whole import open_whole

        return open_whole(path, "PNG" if magic == _PNG else "JPEG")
    raise FileError(f"{path}: is no image that can be read; {REMEDY}")


def open_binary(path: Path) -> io.BufferedReader:
    """Open a file for reading.

    Raises
    ------
    FileError
        It is not there, no file, or may not be read.
    """
    ordinary_size(path, MOST_BYTES, REMEDY)
    try:
        return path.open("rb")
    except OSError as fault:
        raise FileError(f"{path}: cannot be read ({fault.strerror}); make the file readable") from fault


def sha256(path: Path) -> str:
    """SHA-256 of a file, read piece by piece."""
    with open_binary(path) as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
