"""SHA-256 of a file's bytes, and nothing but bytes of an ordinary file."""

from __future__ import annotations

import hashlib
import os
import stat
from pathlib import Path

from data_schemas.contents import shown
from data_schemas.errors import FileError
from pipeline.batch.config import Kind


def input_sha256(path: Path, kind: Kind) -> str:
    """Hexadecimal SHA-256 of an input; where a file beside it is read with it, of both their checksums."""
    digest = file_sha256(path)
    beside = kind.beside(path) if kind.beside is not None else None
    if beside is None or not os.path.isfile(beside):
        return digest
    return hashlib.sha256(f"{digest} {file_sha256(beside)}".encode()).hexdigest()


def file_sha256(path: str | os.PathLike[str]) -> str:
    """Hexadecimal SHA-256 of an ordinary file.

    `FileError` where there is none, it may not be read, or is a folder, a FIFO, a device: nothing that could hang.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with os.fdopen(descriptor, "rb", buffering=0) as file:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise FileError(f"{shown(path, 400)}: is not an ordinary file; give one")
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(f"{shown(path, 400)}: {reason}; give the path of a file that can be read") from None
