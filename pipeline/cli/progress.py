"""Progress bars on stderr, where a person watches: of long simulations and batches, and of reading a film."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def progress(what: str, unit: str) -> Iterator[Callable[..., None] | None]:
    """A function of the stage, if there are several, of how much is done, and of how much; it draws a bar.

    None where stderr is no terminal. What takes less than half a second gets no bar.
    """
    if not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    with tqdm(desc=what, unit=unit, unit_scale=True, file=sys.stderr, leave=False, delay=0.5) as bar:

        def draw(*told: str | int, note: str = "") -> None:
            *stage, done, total = told
            name = ": ".join([what, *map(str, stage)])
            if stage and (bar.desc != f"{name}: " or total != bar.total):
                bar.reset(total)
                bar.set_description(name, refresh=False)
            bar.total = total
            bar.set_postfix_str(note, refresh=False)
            bar.update(done - bar.n)

        yield draw
