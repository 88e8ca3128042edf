"""Whether a file is the image of a film."""

from __future__ import annotations

from pathlib import Path

_MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+", b"\x89PNG", b"\xff\xd8\xff")


def is_image(path: Path) -> bool:
    """Whether a file begins as TIFF, PNG or JPEG do; a file that cannot be read does not."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as stream:
            return stream.read(4).startswith(_MAGIC)
    except (OSError, ValueError):
        return False
