"""Regimes of the harmonic balance: table 3.1, residuals, completeness against a search, symmetries, following."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import root

from data_schemas.errors import UsageError
from synth.huygens.balance import Regime, followed, residuals, solutions
from synth.huygens.clocks import Clocks
from synth.huygens.locking import rates, slope
from synth.huygens.paper import COUPLING, DAMPING, corrected, printed

TABLE = (  # formula sheet 3.1: alpha, beta, q, tau, k
    (-0.175, "0.0547902", "0.000979708", "-0.0510717", "1569.91"),
    (-0.35, "0.0237448", "0.00184062", "-0.0218190", "431.683"),
    (-0.5, "0.0128419", "0.00240420", "-0.0113965", "250.323"),
    (-0.25 * math.pi, "0", "0.00285714", "0", "175"),
    (-1.1, "-0.0145579", "0.00230999", "0.0133935", "263.823"),
)
PAIR = Clocks(0.02, 0.02, COUPLING, (-0.0114, -0.0114))
COEXISTING = Clocks(0.002, 0.2, COUPLING, (0.005, 0.005))


def random_clocks(seed: int) -> Clocks:
    chance = np.random.default_rng(seed)
    damping, drive = 10.0 ** chance.uniform(-3.0, -1.0, 2)
    coupling = damping * drive * 10.0 ** chance.uniform(-2.0, 0.7)
    reach = math.sqrt(coupling * drive / damping)
    tau = chance.uniform(-1.0, 1.0) * reach
    swing = float(chance.choice([0.0, 0.3 * math.sqrt(reach)]))
    return Clocks(float(damping), float(drive), float(coupling), (float(tau), float(tau)), swing).detuned(
        float(chance.uniform(-0.3, 0.3) * coupling / damping)
    )


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"{row[0]:.3f}")
def test_table_31_to_its_printed_digits(row: tuple[float, str, str, str, str]) -> None:
    found = printed(row[0], DAMPING, COUPLING)
    for value, text in zip((found.beta, found.q, found.tau, found.slope), row[1:], strict=True):
        digits = len(text.partition(".")[2])
        assert abs(float(value) - float(text)) <= 0.5000001 * 10.0**-digits


def of_chain(alpha: float, drive: float) -> Clocks:
    """Clocks whose symmetric regime has this alpha, at delta0 = 0.02 of its own frequency."""
    chain = corrected(alpha, drive, DAMPING, COUPLING)
    stretch = math.sqrt(1.0 + float(chain.beta))
    return Clocks(DAMPING / stretch, drive / stretch, COUPLING, (float(chain.tau),) * 2)


@pytest.mark.parametrize("drive", [0.005, 0.05, 0.2])
@pytest.mark.parametrize("alpha", [-0.35, -0.25 * math.pi, -1.1])
def test_the_corrected_chain_is_the_symmetric_regime(alpha: float, drive: float) -> None:
    clocks, chain = of_chain(alpha, drive), corrected(alpha, drive, DAMPING, COUPLING)
    near = min(solutions(clocks, shifts=True), key=lambda each: abs(each.alpha[0] - alpha) + abs(each.offset))
    assert near.alpha == pytest.approx((alpha, alpha), abs=1e-9)
    assert near.beta == pytest.approx(float(chain.beta), abs=1e-12)
    assert near.q == pytest.approx(float(chain.q), rel=1e-9)
    assert near.amplitude == pytest.approx((float(chain.amplitude),) * 2, rel=1e-9)
    assert slope(near, clocks, shifts=True) == pytest.approx(float(chain.slope), rel=2e-4)  # finite difference in chi


@pytest.mark.parametrize("seed", range(6))
def test_residuals_and_fixed_points(seed: int) -> None:
    """Residuals of (7)-(8) below 1e-12; with the shifts, fixed points of the slow flow as well."""
    clocks = random_clocks(seed)
    for shifts in (False, True):
        found = solutions(clocks, shifts=shifts)
        for regime in found:
            assert np.abs(residuals(regime, clocks, shifts=shifts)).max() < 1e-12
            if shifts:
                state = np.array([*regime.alpha, *regime.amplitude, regime.q, 0.0])
                assert np.abs(rates(state, regime.beta, clocks)).max() < 1e-12


@pytest.mark.parametrize("clocks", [PAIR.detuned(3e-4), COEXISTING.detuned(1e-5), random_clocks(3)], ids=str)
def test_a_search_from_everywhere_finds_nothing_else(clocks: Clocks) -> None:
    """Newton on the six equations as printed, from 300 random places: every root is in the list."""
    listed, chance = solutions(clocks), np.random.default_rng(1)
    feed = clocks.coupling * clocks.drive / (4.0 * clocks.beam_damping)
    met = set()

    def left(x: np.ndarray) -> np.ndarray:
        shape = Regime(max(x[0], -0.99), x[1], (x[2], x[3]), (x[4], x[5]))
        return residuals(shape, clocks) / math.sqrt(feed)

    for _ in range(300):
        q = chance.uniform(0.0, math.sqrt(feed))
        beta = chance.uniform(-1.5, 1.5) * math.sqrt(feed) - clocks.mean_detuning
        found = root(left, [beta, q, *chance.uniform(-1.5, 1.5, 2), *chance.uniform(0.5, 2.2, 2)], tol=1e-14)
        if not found.success or found.x[1] < 1e-7 or min(found.x[4:]) < 0.1 or np.abs(left(found.x)).max() > 1e-10:
            continue
        near = [abs(each.beta - found.x[0]) + abs(each.q - found.x[1]) for each in listed]
        assert min(near) < 1e-6 * math.sqrt(feed), found.x
        met.add(int(np.argmin(near)))
    assert len(met) >= min(2, len(listed))  # the search itself is worth something


def test_three_coexisting_in_phase_and_quadrature() -> None:
    """delta0 = .002, delta = .2, tau = .005."""
    found = solutions(COEXISTING, shifts=True)
    in_phase = [each.beta for each in found if abs(each.offset) < 1e-6]
    assert in_phase == pytest.approx([-0.00725, 0.0, 0.00725], abs=5e-5)
    assert [abs(each.offset) for each in found if each.q == 0.0] == [0.5 * math.pi]
    assert len(found) == 4


def test_exchanging_the_clocks_exchanges_the_regimes() -> None:
    here, there = PAIR.detuned(2e-4), PAIR.detuned(-2e-4)
    for one, other in zip(solutions(here), solutions(there), strict=True):
        assert one.alpha == pytest.approx(other.alpha[::-1], abs=1e-9)
        assert one.beta == pytest.approx(other.beta, abs=1e-13)


def test_following_meets_the_exact_search() -> None:
    for regime in solutions(PAIR.detuned(1e-4)):
        moved = followed(regime, PAIR.detuned(1.5e-4))
        assert moved is not None
        assert (
            min(
                abs(moved.beta - each.beta) + abs(moved.offset - each.offset)
                for each in solutions(PAIR.detuned(1.5e-4))
            )
            < 1e-9
        )


def test_nothing_locks_far_apart() -> None:
    assert solutions(PAIR.detuned(0.02)) == []


@pytest.mark.parametrize(
    ("clocks", "said"),
    [
        (PAIR._replace(beam_damping=0.0), "beam_damping = 0"),
        (PAIR._replace(drive=math.nan), "drive = nan"),
        (PAIR._replace(detuning=(-1.0, 0.0)), "detuning = -1"),
        (PAIR._replace(swing=-0.1), "swing = -0.1"),
    ],
)
def test_what_cannot_be_meant(clocks: Clocks, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        solutions(clocks)


def test_a_chain_outside_its_range() -> None:
    with pytest.raises(UsageError, match="give -pi/2 < alpha < 0"):
        printed(0.3)
    with pytest.raises(UsageError, match="drive = 0"):
        corrected(-0.3, 0.0)


def test_equal_clocks_may_stand_unequally() -> None:
    """In the full system a mirrored pair of regimes lies between in phase and quadrature: v_1 = -v_2, not v_1 = v_2."""
    found = solutions(Clocks(0.02, 0.01, 1.2e-4, (0.028, 0.028), 0.2), shifts=True)
    assert len(found) == 4
    one, other = (each for each in found if 1e-3 < abs(each.offset) < 1.5)
    assert one.offset == pytest.approx(-other.offset, abs=1e-9)
    assert one.amplitude == pytest.approx(other.amplitude[::-1], abs=1e-9)
    assert abs(one.amplitude[0] - one.amplitude[1]) > 1e-3
