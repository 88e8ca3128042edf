"""A progress bar on stderr, only where a person sees it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeVar

Item = TypeVar("Item")


def progress(items: Iterable[Item], what: str, total: int | None = None) -> Iterator[Item]:
    """Pass items on; draw a bar if stderr is a terminal."""
    from tqdm import tqdm

    yield from tqdm(items, desc=what, total=total, disable=None, leave=False)
