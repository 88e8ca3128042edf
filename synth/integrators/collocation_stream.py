"""Long motions of clocks on a yielding support piece by piece, in memory that does not grow with their length."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from numpy.typing import ArrayLike

from synth.integrators.collocation import refined
from synth.integrators.collocation_run import run
from synth.integrators.trajectory import Stream, onward, rehearsal
from synth.phase import Floats


def stream(
    system: Any, start: ArrayLike, chunks: Iterable[Floats], span: tuple[float, float], *, tolerance: float = 1e-10
) -> Stream:
    """As `collocation.integrate`, for times that come in chunks.

    The limits and the error are found by marches that keep few states; the motion is then marched once more, from the
    end of one chunk to that of the next.

    Parameters
    ----------
    system, start, tolerance
        As there.
    chunks : iterable of (k,) arrays
        Increasing times, over all chunks.
    span : (float, float)
        Time of the start, and a time that no chunk goes beyond.

    Examples
    --------
    >>> import numpy as np
    >>> from synth.systems.flexible_frame import FlexibleFrame
    >>> frame = FlexibleFrame(2.0, np.full(2, 0.2), np.array([0.25, 0.24]), 150.0, 0.0, 9.81)
    >>> pieces = stream(frame, [0, 0, 0.1, 0, -0.1, 0], [np.array([0.0, 0.5]), np.array([1.0])], (0.0, 1.0))
    >>> [piece.states.shape for piece in pieces]
    [(2, 6), (1, 6)]
    """
    first, instants = rehearsal(start, span)
    made = refined(system, first, instants, tolerance)

    def march(state: Floats, times: Floats) -> Floats:
        return run(made.problem, state, times, made.run.limits, depth=made.run.depth)[0]

    return Stream(onward(march, first, span[0], chunks), made.error, made.steps, made.evaluations, made.rejected)
