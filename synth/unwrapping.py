"""Phase of a signal, unwrapped beside a phase that runs nearly as it does; whole records or portions of them."""

from __future__ import annotations

import numpy as np

from synth.phase import Floats, Phasors

_TURN = 2 * np.pi


class Unwrapping:
    """Unwraps portion after portion, in order of time, as if the signal had come whole.

    The signal's own phase may turn by half a turn between readings; the difference from the base moves slowly. The
    turns of that difference are counted in whole numbers, which do not depend on the portions.

    Examples
    --------
    >>> base = np.arange(0.0, 20.0, 2.5)[None]
    >>> unwrapped = Unwrapping()
    >>> halves = [unwrapped(np.exp(0.9j * base[:, half]), base[:, half]) for half in (slice(4), slice(4, None))]
    >>> bool(np.allclose(np.hstack(halves), 0.9 * base))
    True
    """

    def __init__(self) -> None:
        self._last: Floats | None = None
        self._turns: Floats | None = None

    def __call__(self, signal: Phasors, base: Floats) -> Floats:
        """Phase of the next portion, (pendulums, readings), rad.

        Parameters
        ----------
        signal : (pendulums, readings) complex128
        base : (pendulums, readings) float64
            rad
        """
        beside = np.remainder(np.angle(signal) - base, _TURN)
        if not beside.size:
            return beside
        if self._last is None or self._turns is None:
            self._last = beside[:, :1]
            # The whole turns are chosen so that the phase begins within half a turn of zero.
            self._turns = -np.rint((beside[:, :1] + base[:, :1]) / _TURN)
        turns = self._turns - np.cumsum(np.rint(np.diff(beside, prepend=self._last) / _TURN), axis=-1)
        self._last, self._turns = beside[:, -1:].copy(), turns[:, -1:].copy()
        turns *= _TURN
        beside += turns
        beside += base
        return beside
