"""What a batch that goes on need not do again: never because a file exists, but because it is still what it was."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from data_schemas.errors import FileError
from pipeline.batch.config import Config, owner_of
from pipeline.batch.ledger import NAME, Index
from pipeline.batch.record import file_sha256, input_sha256


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
    """Remove what killed processes of a batch left half-written in its folder and below, and say how many.

    Folders with a ledger of their own are another batch's, and not entered. `FileError` where one cannot be removed.
    """
    count, begins = 0, f".isochrony-{owner_of(folder)}"
    for place, below, names in os.walk(folder):
        below[:] = [name for name in below if not os.path.lexists(os.path.join(place, name, NAME))]
        for name in names:
            if name.startswith(begins) and name.endswith(".part"):
                path = os.path.join(place, name)
                try:
                    os.unlink(path)
                except OSError as error:
                    raise FileError(f"{path}: cannot be removed, {error.strerror}; remove it yourself") from None
                count += 1
    return count


def _sum_of(checksum: Callable[..., str], *of: object) -> str | None:
    try:
        return checksum(*of)
    except FileError:  # not there, or not a file: nothing has that checksum
        return None
