"""A BigTIFF in strips, written strip by strip in any order, whole or not there."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

import numpy as np
from numpy.typing import NDArray

from data_schemas.contents import shown
from data_schemas.errors import FileError, UsageError
from data_schemas.writing import beside, give_name, may_write, reason
from synth.film.pixels import STRIP


class ImageFile:
    """An image of known size; a context manager, whose end without `publish` leaves nothing behind.

    Parameters
    ----------
    path : path
        Of the file to make; its folder must exist.
    rows, columns, bits : int
    dpi : float
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    FileError
        As `data_schemas.write`, from any method.
    UsageError
        The package tifffile is not there.
    """

    def __init__(
        self, path: str | os.PathLike[str], rows: int, columns: int, bits: int, dpi: float, *, overwrite: bool = False
    ) -> None:
        self._path, self._overwrite = path, overwrite
        self._shape, self._bits, self._dpi = (rows, columns), bits, dpi
        self._target = Path(os.path.realpath(path))
        self._temporary = beside(self._target)
        self._file: IO[bytes] | None = None
        self._begin = 0

    def __enter__(self) -> Self:
        tifffile = required_tifffile()
        with self._told():
            may_write(self._target, self._path, self._overwrite)
            with tifffile.TiffWriter(self._temporary, bigtiff=True, byteorder="<") as made:
                self._begin, _ = made.write(
                    shape=self._shape, dtype=f"uint{self._bits}", rowsperstrip=STRIP, photometric="minisblack",
                    resolution=(self._dpi, self._dpi), resolutionunit="INCH", software="isochrony", metadata=None,
                    returnoffset=True,
                )  # fmt: skip
            self._file = open(self._temporary, "r+b")  # closed at the end of the block
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with contextlib.suppress(OSError):
            if self._file is not None:
                self._file.close()
        with contextlib.suppress(OSError):  # renamed already, or never made
            self._temporary.unlink()

    def write(self, first: int, pixels: NDArray[Any]) -> None:
        """Write rows from number `first` on."""
        assert self._file is not None
        with self._told():
            self._file.seek(self._begin + first * self._shape[1] * self._bits // 8)
            self._file.write(np.ascontiguousarray(pixels, dtype=f"<u{self._bits // 8}").data)

    def finish(self) -> None:
        """Bring the file to the disk, so that `publish` only gives it its name."""
        assert self._file is not None
        with self._told():
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()

    def publish(self) -> None:
        """Give the finished file its name, in one step."""
        with self._told():
            give_name(self._temporary, self._target, self._path, self._overwrite)

    @contextlib.contextmanager
    def _told(self) -> Any:
        try:
            yield
        except OSError as error:
            raise FileError(f"{shown(self._path, 400)}: cannot be written, {reason(error)}") from error


def required_tifffile() -> Any:
    """The package that lays out TIFF files.

    Raises
    ------
    UsageError
        It is not installed.
    """
    try:
        import tifffile
    except ImportError:
        raise UsageError("films need the package tifffile; install it with: pip install 'isochrony[film]'") from None
    return tifffile
