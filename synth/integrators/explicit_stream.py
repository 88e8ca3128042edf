"""Long motions piece by piece, in memory that does not grow with their length.

The tolerance of the march is found first, by marches that keep few states (`explicit_error`); what is then streamed is
the last of them once more. So the error is known, and every refusal made, before the first piece is written.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import UsageError
from synth.integrators.events import decided
from synth.integrators.events_kick import Crossings, Escapement
from synth.integrators.explicit import checked
from synth.integrators.explicit_error import Refinement, refine
from synth.integrators.explicit_run import Walk
from synth.integrators.trajectory import Piece, Stream
from synth.phase import Floats


def stream(
    system: Any,
    start: ArrayLike,
    chunks: Iterable[Floats],
    span: tuple[float, float],
    *,
    tolerance: float = 1e-10,
    event: Crossings | Escapement | None = None,
) -> Stream:
    """As `explicit.integrate` and `events.integrate_with_events`, for times that come in chunks.

    Parameters
    ----------
    system, start, tolerance, event
        As there.
    chunks : iterable of (k,) arrays
        Increasing times, s, over all chunks. How they are cut changes no bit of the states.
    span : (float, float)
        Time of the start, and a time that no chunk goes beyond.

    Returns
    -------
    Stream

    Examples
    --------
    >>> from synth.systems.driven_pendulums import plain
    >>> pieces = stream(plain(2.0), [0.1, 0.0], [np.array([0.0, 0.5]), np.array([1.0])], (0.0, 1.0))
    >>> [round(float(piece.states[-1, 0]), 6) for piece in pieces]
    [0.054091, -0.041508]
    """
    first, ends = checked(start, np.array(span), tolerance)
    made = refine(system, event, first, ends, tolerance)
    if event is not None:
        decided(made, event)
    pieces = _pieces(system, event, first, chunks, ends, made)
    return Stream(pieces, made.estimated_error, made.cost(0), made.cost(2), made.cost(1))


def _pieces(
    system: Any, event: Any, start: Floats, chunks: Iterable[Floats], span: Floats, made: Refinement
) -> Iterator[Piece]:
    best, reached = made.runs[-1], float(span[0])
    walk = Walk(system, event, start, reached, float(span[1]), best.tolerance)
    for times in chunks:
        instants = np.array(times, dtype=np.float64)
        if instants.size and not (reached <= instants[0] and instants[-1] <= span[1] and np.all(np.diff(instants) > 0)):
            raise UsageError(f"times of a chunk must increase within {reached!r} to {float(span[1])!r} s")
        reached = float(instants[-1]) if instants.size else reached
        yield Piece(walk.onward(instants), *walk.happenings())
