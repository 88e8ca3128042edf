"""What a batch that goes on need not do again: never because a file exists, but because it is still what it was."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from data_schemas.errors import FileError
from pipeline.batch.config import Config
from pipeline.batch.ledger import Index
from pipeline.batch.record import file_sha256, input_sha256

LEFTOVER = ".isochrony-*.part"
"""What a killed process leaves of a file that it was writing."""


def holds(path: Path, config: Config, ledger: Index, *, retry_failed: bool = False) -> bool:
    """Whether the ledger's outcome of a job still holds: same input, settings and versions, and the output verifies.

    `retry_failed`: what failed is to be done again; what a method refused it would refuse again.
    """
    place = ledger.places.get(config.key)
    if place is None or not place.fits(config, ledger.versions):
        return False
    if place.status == "failed" and retry_failed:
        return False
    if _sum_of(input_sha256, path, config.kind) != place.input_sha256:
        return False
    return place.output_sha256 is None or _sum_of(file_sha256, config.output) == place.output_sha256


def remove_leftovers(folder: Path) -> int:
    """Remove what killed processes left half-written in a folder and below, and say how many; nobody else may write.

    `FileError` where one cannot be removed.
    """
    count = 0
    for path in folder.rglob(LEFTOVER):
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise FileError(f"{path}: cannot be removed, {error.strerror}; remove it yourself") from None
        count += 1
    return count


def _sum_of(checksum: Callable[..., str], *of: object) -> str | None:
    try:
        return checksum(*of)
    except FileError:  # not there, or not a file: nothing has that checksum
        return None
