from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest

from synth.phase import turns
from synth.propagators.closed_form import beat


@pytest.mark.parametrize("own", [6.0, 6.0 + 1e-12, 6.0 - 2**-40, 6.01, 7.2])
@pytest.mark.parametrize("damping_rate", [0.0, 1e-4])
def test_quotient_is_exact_for_any_split_and_time(own: float, damping_rate: float) -> None:
    """(exp(i m t) - exp(lambda t))/mu: at large |mu t| the expm1 form would lose digits, at small the plain one."""
    index = np.array([0, 1, -1, 16, 1600, 57_600])
    seconds = index / 16
    rates = turns([6.0, own], Fraction(1, 16))
    forced, free = rates.phasors(index)
    split = np.array([[damping_rate + 1j * (6.0 - own)]])
    found = beat(split, forced[None], (free * np.exp(-damping_rate * seconds))[None], seconds)[0]
    mpmath.mp.dps = 50
    for t, value in zip(seconds.tolist(), found.tolist(), strict=True):
        mu = mpmath.mpc(damping_rate, mpmath.mpf(6.0) - mpmath.mpf(own))
        end = mpmath.exp(mpmath.mpc(-damping_rate, own) * t)
        exact = t * end if mu == 0 else (mpmath.expj(6.0 * t) - end) / mu
        size = min(abs(t), 2 / abs(mu)) if mu else abs(t)  # the largest that the quotient can be
        assert abs(mpmath.mpc(value) - exact) <= 2e-15 * size
