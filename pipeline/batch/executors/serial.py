"""One record after the other in this process: no isolation, for files that are trusted."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from pathlib import Path

from pipeline.batch.config import Config
from pipeline.batch.outcome import Outcome
from pipeline.batch.record import process_record


def serial(jobs: Iterable[tuple[Path, Config]]) -> Generator[list[Outcome]]:
    """Outcomes of jobs in their order, one at a time."""
    for path, config in jobs:
        yield [process_record(path, config)]
