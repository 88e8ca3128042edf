"""A film's exposure, piece by piece, so that none holds the image."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline.film.parts import Emulsion, Floats
from pipeline.film.scan.opening import OpenScan

Item = TypeVar("Item")
Result = TypeVar("Result")
Spans = Sequence[tuple[int, int]]  # First and last rows of stretches of film

ROWS = 1024  # of a piece
MARGIN = 24  # rows read on either side, so that a gap at a seam is seen whole
LIGHTEST, GRAIN_STEPS = 2.5, 320  # exposure up to which the grain is tabulated


def in_order(work: Callable[[Item], Result], items: Iterable[Item], jobs: int = 1) -> Iterator[Result]:
    """Results of `work` on each of the items, in their order.

    With several jobs the calls run in threads; items are asked for in the caller's thread, at most `jobs` of them ahead
    of the results: none holds the film.

    Examples
    --------
    >>> list(in_order(abs, [-3, 1, -2], jobs=2))
    [3, 1, 2]
    """
    if jobs == 1:
        yield from map(work, items)
        return
    from concurrent.futures import ThreadPoolExecutor

    waiting = iter(items)
    with ThreadPoolExecutor(jobs) as pool:
        coming = deque(pool.submit(work, item) for item in islice(waiting, jobs + 1))
        try:
            while coming:
                yield coming.popleft().result()
                coming.extend(pool.submit(work, item) for item in islice(waiting, 1))
        finally:
            pool.shutdown(cancel_futures=True)


def over_pieces(
    scan: OpenScan,
    emulsion: Emulsion,
    work: Callable[[int, int, int, NDArray[np.float32]], Result],
    jobs: int,
    spans: Spans | None = None,
) -> list[Result]:
    """What `work` makes of each piece in its order: rows `begin` to `stop`, first row of the exposure, exposure.

    `spans` are first and last rows of the stretches of interest; the whole scan by default.
    """

    def one(piece: tuple[int, int]) -> Result:
        begin, stop = piece
        first = max(begin - MARGIN, 0)
        return work(begin, stop, first, exposed(scan, emulsion, first, min(stop + MARGIN, scan.rows)))

    spans = [(0, scan.rows - 1)] if spans is None else spans
    pieces = [(at, min(at + ROWS, last + 1)) for first, last in spans for at in range(first, last + 1, ROWS)]
    return list(in_order(one, pieces, jobs))


def exposed(scan: OpenScan, emulsion: Emulsion, first: int, stop: int) -> NDArray[np.float32]:
    """Exposure of some rows, (rows, columns), contiguous."""
    pixels: NDArray[Any] = scan.read(first, stop)
    return np.ascontiguousarray(emulsion.exposure(pixels, first), dtype=np.float32)


def grain(emulsion: Emulsion) -> tuple[Floats, float]:
    """1 sigma of the exposure of a pixel at evenly spaced exposures from 0 on, and their spacing."""
    light = np.linspace(0.0, LIGHTEST, GRAIN_STEPS + 1)
    sigma = np.asarray(emulsion.noise(light.astype(np.float32)), dtype=np.float64)
    known = np.isfinite(sigma) & (sigma > 0.0)
    return np.interp(light, light[known], sigma[known]), LIGHTEST / GRAIN_STEPS
