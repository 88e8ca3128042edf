"""The course of a batch: what is to be done goes to an executor, what comes back to the ledger."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from data_schemas.shield import shielded
from pipeline.batch.config import Config
from pipeline.batch.ledger import Ledger
from pipeline.batch.log import Log
from pipeline.batch.outcome import Outcome
from pipeline.batch.resume import holds

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
    jobs: Sequence[Job],
    ledger: Ledger,
    executor: Executor,
    log: Log,
    tally: Tally,
    *,
    anew: bool = False,
    retry_failed: bool = False,
    limit: int | None = None,
    progress: Callable[..., object] | None = None,
) -> None:
    """Do all jobs that are not done; `FileError` where the ledger or the log cannot be written.

    Parameters
    ----------
    executor : callable
        Closed when this ends, however it ends.
    tally : Tally
        Counted as things happen, so that it is right after an interrupt too.
    anew, retry_failed : bool
        Do everything, whatever the ledger knows; do what failed again.
    limit : int, optional
        Most jobs to do.
    progress : callable, optional
        Told how many are done, of how many, and as `note` how many of them gave no value.
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
