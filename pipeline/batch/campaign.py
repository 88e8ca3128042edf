"""The course of a batch: what still holds is kept, the rest goes to an executor, what comes back to the ledger.

Nothing is kept because a file exists, but because it is still what it was.
"""

import contextlib
import itertools
import os
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from data_schemas.errors import FileError
from data_schemas.shield import shielded
from data_schemas.text_files import file_sha256
from pipeline.batch.job import Config, Outcome, input_sha256, owner_of
from pipeline.batch.ledger import NAME, Index, Ledger, Log


def holds(path: Path, config: Config, ledger: Index, *, retry_failed: bool = False) -> bool:
    """Whether a job's outcome holds: same input, settings, versions, output; `retry_failed`: none that failed does."""
    place = ledger.places.get(config.key)
    if place is None or not place.fits(config, ledger.versions) or (place.status == "failed" and retry_failed):
        return False
    if _sum_of(input_sha256, path, config.kind) != place.input_sha256:
        return False
    return place.output_sha256 is None or _sum_of(file_sha256, config.output) == place.output_sha256


def remove_leftovers(folder: Path) -> int:
    """Remove what killed processes left half-written in a batch's folder; how many. `FileError` where it fails."""
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


Job = tuple[Path, Config]
Executor = Callable[[Iterable[Job]], Generator[list[Outcome]]]


@dataclass
class Tally:
    """How far a batch has come; of `total` inputs `kept` needed nothing to be done, and `bad` gave no value."""

    total: int
    kept: int = 0
    done: int = 0
    bad: int = 0


def run(
    jobs: Sequence[Job], ledger: Ledger, executor: Executor, log: Log, tally: Tally, *, anew: bool = False,
    retry_failed: bool = False, limit: int | None = None, progress: Callable[..., object] | None = None,
) -> None:  # fmt: skip
    """Do at most `limit` jobs that are not done; `FileError` where the ledger or the log cannot be written.

    The executor is closed when this ends, however it ends; the tally counts as things happen, so that it is right
    after an interrupt too. `anew`: do everything, whatever the ledger knows; `retry_failed`: do what failed again.
    `progress` is told how many are done, of how many, and as `note` how many of them gave no value.
    """
    configurations: dict[str, str] = {}
    for _, config in jobs:
        place = ledger.places.get(config.key)
        if place is not None and not place.fits(config, ledger.versions):
            del ledger.places[config.key]  # nothing of these settings is known of it, also if it is left for later

    def undone() -> Iterator[Job]:
        for path, config in jobs:
            if not anew and holds(path, config, ledger, retry_failed=retry_failed):
                tally.kept += 1
            else:
                configurations[config.key] = config.sha256
                yield path, config

    with contextlib.closing(executor(itertools.islice(undone(), limit))) as coming:
        for outcomes in coming:
            with shielded():
                ledger.append(outcomes, configurations)
                tally.done += len(outcomes)
                tally.bad += sum(one.status != "ok" for one in outcomes)
            for one in outcomes:
                del configurations[one.key]
                log.event("record", key=one.key, status=one.status, error_class=one.error_class, seconds=one.seconds)
            if progress is not None:
                note = f"{tally.bad} without a value" if tally.bad else ""
                progress(tally.done + tally.kept, tally.total, note=note)
