"""The progress bar of reading a film, on stderr, where a person watches: one bar a stage."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def film_progress(what: str) -> Iterator[Callable[[str, int, int], None] | None]:
    """A function of the stage, of how much of it is done, and of how much; None where stderr is no terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    with tqdm(unit=" rows", unit_scale=True, file=sys.stderr, leave=False, delay=0.5) as bar:

        def draw(stage: str, done: int, total: int) -> None:
            name = f"{what}: {stage}"
            if bar.desc != f"{name}: " or total != bar.total:
                bar.reset(total)
                bar.set_description(name, refresh=False)
            bar.update(done - bar.n)

        yield draw
