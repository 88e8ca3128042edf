"""What every integrator returns, and the one definition of its error estimate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synth.phase import Floats


@dataclass(frozen=True)
class Trajectory:
    """States at the requested times, with what they cost and how good they are."""

    times: Floats
    """(k,) s, increasing."""
    states: Floats
    """(k, n) states at `times`."""
    estimated_error: float
    """Largest estimated error of any component at any of `times`, relative to the largest size of that component
    anywhere on the way (start, steps and `times`); see `relative_error`."""
    steps: int
    """Accepted steps."""
    evaluations: int
    """Calls of the derivative, those of rejected steps and of the error estimate included."""
    rejected: int
    """Steps that were tried and given up."""


def relative_error(difference: Floats, largest: Floats) -> float:
    """Largest of |difference| (k, n) over `largest` (n,); a component that never left zero counts as it is.

    Examples
    --------
    >>> relative_error(np.array([[1e-9, -2e-9]]), np.array([1.0, 0.5]))
    4e-09
    """
    size = np.where(largest > 0.0, largest, 1.0)
    return float(np.max(np.abs(difference) / size, initial=0.0))
