"""Which trace found on the film is which trace described: by where it rests, then by how far it swings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import permutations

import numpy as np

from data_schemas.errors import RecordError
from data_schemas.film_description import DescribedTrace
from pipeline.film.parts import Floats

_MOST_TRACES = 7
_FACTOR = 5.0  # mm: a swing wrong by a factor of e counts as a place wrong by this


def match(described: Sequence[DescribedTrace], rest: Floats, swing: Floats) -> list[int]:
    """For each described trace, the number of the one found.

    Without a place for each, traces are described as they lie from the left to the right. The scan need not begin at
    the paper's edge: a shift common to all places does not count.

    Parameters
    ----------
    described : sequence of DescribedTrace
    rest, swing : (found,) arrays
        Where the traces found rest and how far they swing, mm.

    Raises
    ------
    RecordError
        More or fewer traces were found than are described, or too many.
    """
    count = len(described)
    if rest.size != count:
        names = ", ".join(trace.name for trace in described)
        raise RecordError(
            f"{_traces(rest.size)} found on the film, but {count} described ({names}); say which are there with --trace"
        )
    if any(trace.position is None for trace in described):
        return [int(k) for k in np.argsort(rest, kind="stable")]
    if count > _MOST_TRACES:
        raise RecordError(f"{count} traces are described; at most {_MOST_TRACES} can be told apart")
    places = np.array([trace.position for trace in described], dtype=np.float64)
    sizes = [trace.amplitude for trace in described]

    def strangeness(order: Iterable[int]) -> float:
        order = list(order)
        # a shift of all places alike costs every order the same
        cost = float(np.sum((rest[order] - places) ** 2))
        for size, found in zip(sizes, order, strict=True):
            if size is not None and swing[found] > 0.0:
                cost += (_FACTOR * float(np.log(swing[found] / size))) ** 2
        return cost

    return list(min(permutations(range(count)), key=strangeness))


def _traces(count: int) -> str:
    return "no trace was" if count == 0 else "1 trace was" if count == 1 else f"{count} traces were"
