"""How far a difference of the clocks' rates turns them apart: k = d eta/d chi, by balance and orbit; and n <-> chi.

A clock that is alone n swings a day faster keeps, once synchronised, an advance eta of phase instead. `chi` is the
difference tau_1 - tau_2 of the clocks when each is alone, `eta` that of their alpha.
"""

from __future__ import annotations

import math

from data_schemas.errors import RefusedError, UsageError
from synth.huygens.balance import Regime, followed
from synth.huygens.clocks import Clocks
from synth.huygens.orbit import orbit

DAY = 86400.0
_BALANCE_STEP, _ORBIT_STEP = 1e-7, 1e-6
"""chi: large against rounding over k, small against what makes k change."""


def slope(regime: Regime, clocks: Clocks, *, shifts: bool = False) -> float:
    """k of the six equations (7)-(8), by following a regime to both sides.

    Parameters
    ----------
    regime : Regime
        Of these clocks, from `balance.solutions` with the same `shifts`.
    clocks : Clocks
        Their mean tau and chi are where k is taken.

    Raises
    ------
    RefusedError
        If the regime ends right here.

    Examples
    --------
    >>> from synth.huygens.balance import solutions
    >>> pair = Clocks(0.02, 0.02, 5.7143e-5, (-0.0114, -0.0114))
    >>> round(slope(solutions(pair)[1], pair), 1)
    274.6
    """
    apart = clocks.detuning[0] - clocks.detuning[1]
    ends = []
    for step in (_BALANCE_STEP, -_BALANCE_STEP):
        found = followed(regime, clocks.detuned(apart + step), shifts=shifts)
        if found is None:
            raise RefusedError("the regime ends at this difference of rates; take k at a smaller one")
        ends.append(found.offset)
    return math.remainder(ends[0] - ends[1], math.pi) / (2.0 * _BALANCE_STEP)


def orbit_slope(regime: Regime, clocks: Clocks, *, full: bool = False) -> float:
    """k of the true orbits near a regime (from `balance.solutions` with shifts), of system (2) or the full one."""
    apart = clocks.detuning[0] - clocks.detuning[1]
    ends = [
        orbit(regime, clocks.detuned(apart + step), full=full).regime.offset for step in (_ORBIT_STEP, -_ORBIT_STEP)
    ]
    return math.remainder(ends[0] - ends[1], math.pi) / (2.0 * _ORBIT_STEP)


def chi_of_daily(swings: float, period: float, tau: float) -> float:
    """chi of clocks of which the first makes n swings a day more when each is alone: 2 (1 + tau) n T/day.

    The printed formula lacks the 2: it expands w_i with w0/4 where w0/8 stands.

    Parameters
    ----------
    swings : float
        n, whole swings a day.
    period : float
        Mean full period, s.
    tau : float
        Mean detuning.

    Examples
    --------
    >>> round(chi_of_daily(1.0, 1.0, 0.0), 9)
    2.3148e-05
    """
    _positive(period, tau)
    return 2.0 * (1.0 + tau) * swings * period / DAY


def daily_of_chi(chi: float, period: float, tau: float) -> float:
    """Swings a day that the first clock makes more when each is alone; inverse of `chi_of_daily`."""
    _positive(period, tau)
    return chi * DAY / (2.0 * (1.0 + tau) * period)


def _positive(period: float, tau: float) -> None:
    if not (0.0 < period < math.inf and -1.0 < tau < math.inf):
        raise UsageError(f"period = {period:g} s, tau = {tau:g}: give a period above 0 and a tau above -1")
