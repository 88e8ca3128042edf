"""Arrays along time that come in pieces of any size, cut into portions of the sizes that are wanted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from synth.phase import Floats


def recut(pieces: Iterable[Floats], sizes: Iterable[int]) -> Iterator[Floats]:
    """Cut what comes in pieces anew; no more is held than one portion and one piece.

    `ValueError` if the pieces end too early.

    Parameters
    ----------
    pieces
        (rows, any number of moments) each, in order of time.
    sizes
        Moments of each portion; together no more than the pieces hold.

    Yields
    ------
    (rows, size) float64

    Examples
    --------
    >>> pieces = [np.array([[0.0, 1.0, 2.0]]), np.array([[3.0, 4.0]])]
    >>> [portion.tolist() for portion in recut(pieces, [2, 3])]
    [[[0.0, 1.0]], [[2.0, 3.0, 4.0]]]
    """
    source = iter(pieces)
    held: list[Floats] = []
    have = 0
    for size in sizes:
        while have < size or not held:
            piece = next(source, None)
            if piece is None:
                raise ValueError(f"the motion ends {size - have} moments before the record does")
            held.append(piece)
            have += piece.shape[-1]
        joined = held[0] if len(held) == 1 else np.concatenate(held, axis=-1)
        yield joined[..., :size]
        held, have = [joined[..., size:]], have - size
