"""Long stiff motions piece by piece, in memory that does not grow with their length."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from numpy.typing import ArrayLike

from synth.integrators.radau import refined
from synth.integrators.trajectory import Stream, onward, rehearsal
from synth.phase import Floats


def stream(
    system: Any, start: ArrayLike, chunks: Iterable[Floats], span: tuple[float, float], *, tolerance: float = 1e-10
) -> Stream:
    """As `radau.integrate`, for times that come in chunks.

    The tolerance of the march and the error are found by marches that keep few states; the motion is then marched once
    more, from the end of one chunk to that of the next.

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
    >>> from synth.systems.van_der_pol import VanDerPol
    >>> pieces = stream(VanDerPol(1000.0), [2.0, 0.0], [np.array([0.5]), np.array([1.0])], (0.0, 1.0), tolerance=1e-9)
    >>> [round(float(piece.states[-1, 0]), 9) for piece in pieces]
    [1.999666843, 1.999333371]
    """
    first, instants = rehearsal(start, span)
    made = refined(system, first, instants, tolerance)

    def march(state: Floats, times: Floats) -> Floats:
        return (
            made.problem.begun(state, times).run(made.pair.fine.tolerance, made.reading, made.pair.fine.orders).states
        )

    steps, _, rejected = made.pair.fine.counts.tolist()
    return Stream(onward(march, first, span[0], chunks), made.pair.error, steps, made.evaluations, rejected)
