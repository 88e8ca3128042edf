"""Progress bars on stderr, where a person watches: of long simulations and batches, and of reading a film."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def progress(what: str, unit: str) -> Iterator[Callable[[int, int], None] | None]:
    """A function of how much is done, and of how much, that draws a bar; None where stderr is no terminal.

    What takes less than half a second gets no bar.
    """
    if not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    with tqdm(desc=what, unit=unit, unit_scale=True, file=sys.stderr, leave=False, delay=0.5) as bar:

        def draw(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield draw


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
