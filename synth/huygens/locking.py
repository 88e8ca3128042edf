"""How unlike two clocks may be: how far that turns them apart, whether they still lock, how they slip beyond.

To leading order in nu/(delta delta0) amplitudes and beam follow psi = alpha_1 - alpha_2 at once, and the slow flow is
Adler's equation `psi' = [(1 + beta)/2] (chi - chi_c sin 2 psi)`, signs apart. What follows late or far is put right
in two steps: the regimes psi is led through have a chi(psi) of their own, whose height is the edge (`edge_of_balance`);
and psi answers an excess of chi by `p(psi)`, somewhat more than (1 + beta)/2, since amplitudes and beam help.

A clock that is alone n swings a day faster keeps, once synchronised, an advance eta of phase instead: `chi` is the
difference tau_1 - tau_2 of the clocks when each is alone, `eta` that of their alpha, k = d eta/d chi.
"""

from __future__ import annotations

import math

import numpy as np

from data_schemas.errors import RefusedError, UsageError
from synth.huygens.balance import Regime, followed
from synth.huygens.clocks import Clocks, checked
from synth.huygens.orbit import orbit
from synth.huygens.slow_flow import rates, slopes, stability
from synth.phase import Floats

DAY = 86400.0
_BALANCE_STEP, _ORBIT_STEP = 1e-7, 1e-6  # chi: large against rounding over k, small against what makes k change
_PLACES = 48  # over a quarter of psi's turn: the integrand is smooth and repeats
_NEAR = 1e-4
_SCAN = 24
_BESIDE = 0.01  # of psi: at the fold itself the growth is 0


def edge(clocks: Clocks) -> float:
    """chi_c to leading order in nu/(delta delta0): `(1 + beta) chi_c = nu delta0/(beta^2 + delta0^2)`.

    1 + beta = 1/(1 + tau - delta^2/8), with Phi0^2/2 less too in the full system. Within 7 % of the slow flow's own
    edge (`edge_of_balance`) at delta = delta0 = 0.02 and nu = 5.7e-5. Of the clocks their mean detuning counts.

    Examples
    --------
    >>> round(edge(Clocks(0.02, 0.02, 5.7143e-5, (-0.0114, -0.0114))), 6)
    0.002109
    """
    beta = mean_beta(checked(clocks))
    damping = clocks.beam_damping * math.sqrt(1.0 + beta)
    return clocks.coupling * damping / (beta**2 + damping**2) / (1.0 + beta)


def mean_beta(clocks: Clocks) -> float:
    """beta of quadrature: of the frequency at which the clocks swing when the beam rests."""
    felt = clocks.mean_detuning - clocks.drive**2 / 8.0 - clocks.swing**2 / 2.0
    return 1.0 / (1.0 + felt) - 1.0


def slip(clocks: Clocks, chi: float) -> float:
    """Mean |d psi/dz| beyond the edge, rad a unit of z; 0 below it: Adler's equation with `p(psi)` and chi(psi).

    First order in psi', so good while the slip is slow against delta0 and delta. chi is the difference of the
    detunings; of the clocks their mean detuning counts. `RefusedError` as `edge_of_balance`.

    Examples
    --------
    >>> pair = Clocks(0.02, 0.02, 5.7143e-5, (0.0, 0.0))
    >>> critical = edge_of_balance(pair)
    >>> round(slip(pair, 1.1 * critical) / (0.5 * critical * math.sqrt(1.1**2 - 1.0)), 2)  # over Adler's own
    1.06
    """
    if abs(chi) <= edge_of_balance(clocks):
        return 0.0
    family = _Family(checked(clocks))
    width = 0.5 * math.pi / _PLACES
    duration = 0.0  # over psi from -pi/2 to pi/2, of which the second half mirrors the first
    for place in range(_PLACES):
        psi = -0.5 * math.pi + (place + 0.5) * width
        height, answer = abs(family.chi(psi)), family.answer(psi)
        duration += width / answer * (1.0 / (abs(chi) - height) + 1.0 / (abs(chi) + height))
    return math.pi / duration


def edge_of_balance(clocks: Clocks) -> float:
    """Largest chi at which quadrature's descendant is there and stable: where it folds, or begins to waver before.

    Fixed points of the slow flow lead from quadrature (chi = 0) to the paper's regime (chi = 0 again); psi, which runs
    from -pi/2 to 0, tells them apart. Where the beam is slower than the slip (small delta0) they waver (a Hopf
    bifurcation) before the fold. `RefusedError` if the family breaks off, or is unstable from the first.

    Examples
    --------
    >>> round(edge_of_balance(Clocks(0.02, 0.02, 5.7143e-5, (-0.0114, -0.0114))), 6)
    0.001996
    """
    from scipy.optimize import brentq, minimize_scalar

    family = _Family(checked(clocks))
    places = [float(each) for each in np.linspace(-0.5 * math.pi, -0.05, _SCAN)[1:]]
    heights = [abs(family.chi(psi)) for psi in places]
    top = int(np.argmax(heights))
    if top in (0, len(places) - 1):
        raise RefusedError("the regimes between quadrature and in phase do not fold; look at `solutions` at each chi")
    bounds = places[top - 1], places[top + 1]
    best = minimize_scalar(lambda psi: -abs(family.chi(float(psi))), bounds=bounds, options={"xatol": 1e-7})
    before = [psi for psi in places if psi < best.x - _BESIDE] + [float(best.x) - _BESIDE]
    unstable = next((index for index, psi in enumerate(before) if family.growth(psi) > 0.0), None)
    if unstable is None:
        return float(-best.fun)
    if unstable == 0:
        raise RefusedError("quadrature itself does not attract these clocks; look at `solutions` at each chi")
    wavers = brentq(family.growth, before[unstable - 1], before[unstable], xtol=1e-9)
    return abs(family.chi(float(wavers)))


class _Family:
    """Fixed points of the slow flow by psi = alpha_1 - alpha_2; each start is the nearest one known before.

    The unknowns are mean alpha, A_1, A_2, beta, chi and q; beta, chi and q in units of delta0, chi_c and nu/delta0.
    """

    def __init__(self, clocks: Clocks) -> None:
        self._clocks = clocks
        self._beta, self._edge = mean_beta(clocks), edge(clocks)
        self._swing = clocks.coupling / clocks.beam_damping
        # near quadrature q is small and grows with psi + pi/2; its phase follows the beam's resonance
        phase = math.atan2(clocks.beam_damping, self._beta)
        self._known: dict[float, Floats] = {-0.5 * math.pi + 1e-3: np.array([-0.5 * phase, 2.0, 2.0, 0.0, 2e-3, 1e-3])}

    def chi(self, psi: float) -> float:
        """Difference of the detunings at which the clocks stand psi apart."""
        from scipy.optimize import root

        nearest = min(self._known, key=lambda each: abs(each - psi))
        start = self._known[nearest]
        for turn in (0.0, 0.5 * math.pi):
            for sign in (1.0, -1.0):
                guess = start.copy()
                guess[0] += turn
                guess[4] *= sign
                found = root(self._left, guess, args=(psi,), tol=1e-13)
                if np.abs(self._left(found.x, psi)).max() < 1e-9 and found.x[5] > 0.0 and min(found.x[1:3]) > 0.5:
                    self._known[psi] = found.x
                    return float(found.x[4] * self._edge)
        raise RefusedError(f"no regime with the clocks {psi:.3g} rad apart; look at `solutions` at each chi")

    def answer(self, psi: float) -> float:
        """d psi/dz over the excess of chi that makes it, p(psi), to first order.

        The state is X(psi) + excess Y, so that J Y + F_beta b + F_chi = p dX/dpsi, b a change of beta.
        """
        clocks, chi = self._clocks, self.chi(psi)
        here, beta = self._fixed(psi)
        along = (self._fixed(psi + _NEAR)[0] - self._fixed(psi - _NEAR)[0]) / (2.0 * _NEAR)
        pair, step = clocks.detuned(chi), _NEAR * self._edge
        by_chi = rates(here, beta, clocks.detuned(chi + step)) - rates(here, beta, clocks.detuned(chi - step))
        by_beta = rates(here, beta + step, pair) - rates(here, beta - step, pair)
        matrix = np.column_stack([slopes(here, beta, pair)[:, 2:], by_beta / (2.0 * step), -along])
        return abs(float(np.linalg.solve(matrix, -by_chi / (2.0 * step))[5]))

    def growth(self, psi: float) -> float:
        """Largest rate of a perturbation of the regime, per z."""
        state, beta = self._fixed(psi)
        regime = Regime(beta, float(state[4]), (float(state[0]), float(state[1])), (float(state[2]), float(state[3])))
        return stability(regime, self._clocks.detuned(self.chi(psi))).growth

    def _fixed(self, psi: float) -> tuple[Floats, float]:
        """The fixed point (6,) of the slow flow, and its beta."""
        self.chi(psi)
        return self._place(self._known[psi], psi)

    def _place(self, unknown: Floats, psi: float) -> tuple[Floats, float]:
        """State (6,) of the slow flow and beta that the unknowns stand for."""
        mean, first, second, beta, _, q = unknown.tolist()
        state = np.array([mean + 0.5 * psi, mean - 0.5 * psi, first, second, q * self._swing, 0.0])
        return state, self._beta + self._clocks.beam_damping * beta

    def _left(self, unknown: Floats, psi: float) -> Floats:
        """Rates of the slow flow, in units of what they hold."""
        state, beta = self._place(unknown, psi)
        clocks = self._clocks
        own = 0.5 * clocks.drive * unknown[1:3]
        units = np.array([0.5 * self._swing, 0.5 * self._swing, *own, clocks.coupling, clocks.coupling])
        return np.asarray(rates(state, beta, clocks.detuned(self._edge * unknown[4])) / units)


def slope(regime: Regime, clocks: Clocks, *, shifts: bool = False) -> float:
    """k of the six equations (7)-(8) at the clocks' own tau and chi, by following a regime to both sides.

    The regime is one of `balance.solutions` with the same `shifts`. `RefusedError` if it ends right here.

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
    pairs = (clocks.detuned(apart + step) for step in (_ORBIT_STEP, -_ORBIT_STEP))
    above, below = (orbit(regime, pair, full=full).regime.offset for pair in pairs)
    return math.remainder(above - below, math.pi) / (2.0 * _ORBIT_STEP)


def chi_of_daily(swings: float, period: float, tau: float) -> float:
    """chi of clocks of which the first makes n swings a day more when each is alone: 2 (1 + tau) n T/day.

    The printed formula lacks the 2: it expands w_i with w0/4 where w0/8 stands. T is the mean full period, s; n counts
    whole swings a day; tau is the mean detuning.

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
