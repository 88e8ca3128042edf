"""Long gaps of the first pendulum: cut out with a free step of the swing, joined where the record shows it may be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exact_pair import N2, Pair, milligal, swell
from made_records import GRAVITY, RESONANT, SWELL, row, simulate

from pipeline.estimate import Estimate
from pipeline.methods import method
from pipeline.observation import Observation
from pipeline.outliers import reject_outliers
from pipeline.prepared import prepare
from pipeline.projection.pieces import solve_pieces
from pipeline.projection.uniform import UniformProblem

BEAT = (4e-5, N2 - 0.052, 0.7)  # a vibration of 4e-5 g, two minutes' beat: what no bridge can follow
TIME = np.arange(6000) * 0.1


def run(seen: Observation) -> Estimate:
    return method("projection")(prepare(seen))


def broken(seen: Observation, *gaps: tuple[float, float]) -> Observation:
    """Both series without what lies in the gaps, given in s."""
    missing = np.zeros(seen.time.size, dtype=bool)
    for begin, end in gaps:
        missing |= (seen.time >= begin) & (seen.time < end)
    theta, difference = (np.where(missing, np.nan, series) for series in (seen.theta, seen.difference))
    return replace(seen, theta=theta, difference=difference)


def noisy(seen: Observation, seed: int, noise: float = 1e-5) -> Observation:
    random = np.random.default_rng(seed)
    parts = {name: getattr(seen, name) + random.normal(0.0, noise, seen.time.size) for name in ("theta", "difference")}
    return replace(seen, **parts)


@pytest.mark.parametrize("gaps", [((200.0, 215.0),), ((150.0, 470.0),), ((0.0, 30.0), (100.0, 160.0), (560.0, 600.0))])
@pytest.mark.parametrize("damping_rate", [np.array([3e-4, 1e-4]), None])
def test_what_happens_in_a_long_gap_cannot_matter(
    gaps: tuple[tuple[float, float], ...], damping_rate: np.ndarray | None
) -> None:
    """Noise-free records stay exact (by a bridge 15 s cost 0.03 mGal, and 60 s 3), to the quadrature at 10 Hz."""
    rates = (3e-4, 1e-4) if damping_rate is not None else (1e-4, 1e-4)
    pair = Pair.apart(1e-4, damping=rates, forcing=(*swell(), BEAT))
    found = run(broken(pair.observe(TIME, step=0.1, damping_rate=damping_rate), *gaps))
    assert abs(milligal(found.frequency, N2)) < 3e-5
    assert found.damping_rate == pytest.approx(1e-4, abs=1e-9)


def test_a_difference_read_while_the_first_pendulum_was_not_takes_no_part() -> None:
    pair = Pair.apart(1e-4, forcing=(*swell(), BEAT))
    seen = pair.observe(TIME, step=0.1)
    alone = replace(broken(seen, (200.0, 260.0)), difference=seen.difference)
    assert run(alone).frequency == run(broken(seen, (200.0, 260.0))).frequency


@pytest.mark.compiled
@pytest.mark.parametrize(("rate", "seconds"), [(10.0, 600.0), (2.0, 900.0)])
def test_sigma_holds_across_long_gaps(rate: float, seconds: float) -> None:
    """Root mean square of error over sigma of some records; bridges gave 2 at 25 Hz and 7 at marks."""
    pair = Pair.apart(1e-4, forcing=(*swell(size=0.02), BEAT))
    time = np.arange(round(seconds * rate)) / rate
    seen = pair.observe(time, step=1.0 / rate)
    pulls = []
    for seed in range(10 if rate > 2.0 else 5):
        found = run(
            broken(noisy(seen, seed), (0.2 * seconds, 0.2 * seconds + 15.0), (0.6 * seconds, 0.6 * seconds + 60.0))
        )
        pulls.append((found.frequency - N2) / found.sigma)
    assert 0.3 < np.sqrt(np.mean(np.square(pulls))) < 1.7  # of five Gaussian ones 1 in 60 lies outside


@pytest.mark.compiled
def test_a_gap_that_can_be_bridged_keeps_the_phase() -> None:
    """On still ground trials tell that the bridge holds: sigma is near that of the whole record, not twice it."""
    seen = noisy(Pair.apart(1e-4).observe(TIME, step=0.1), 1)
    whole, found = run(seen), run(broken(seen, (290.0, 310.0)))
    assert found.sigma < 1.2 * whole.sigma
    moving = noisy(Pair.apart(1e-4, forcing=(BEAT,)).observe(TIME, step=0.1), 1)
    assert run(broken(moving, (290.0, 310.0))).sigma > 1.4 * whole.sigma


@pytest.mark.compiled
def test_uneven_times_with_a_long_gap() -> None:
    random = np.random.default_rng(7)
    time = np.sort((np.arange(15000) + random.uniform(-0.25, 0.25, 15000)) / 25.0)
    time -= time[0]
    time = time[(time < 200.0) | (time > 260.0)]
    pair = Pair.apart(1e-4, damping=(3e-4, 1e-4), forcing=(*swell(), BEAT))
    assert abs(milligal(run(pair.observe(time)).frequency, N2)) < 1e-3


@pytest.mark.parametrize("steps", [1e-6, 1e-4, np.inf])
def test_the_chain_is_the_least_squares_with_a_column_for_every_step(steps: float) -> None:
    """The same moments by dense columns, the priors as rows: frequency, its variance and the amplitudes."""
    random = np.random.default_rng(4)
    time, half, noise = np.arange(3000) * 0.1, 149.95, 1e-5
    theta, cut = 1e-4 * np.cos(N2 * time + 1.0), [(90.0, 100.0), (200.0, 220.0)]
    amplitude = 0.01 * np.exp(1j * N2 * time) * (1.0 + 0.01 * (time > 95.0) - 0.02j * (time > 210.0))
    difference = amplitude.real + random.normal(0.0, noise, time.size)
    problem = UniformProblem(theta, difference, 0.1, N2, 1.0001, 0.0, cut)
    problem.respond(N2, 0.0)
    coefficient = np.zeros((3, 3))
    gram, _ = problem.moments(N2, 0.0, coefficient, np.inf)
    found = solve_pieces(gram, coefficient, half, False, np.full(2, steps), noise)
    assert np.isfinite(problem.residual).sum() == sum(piece.stop - piece.start for piece in problem.pieces)

    used = np.concatenate([np.arange(piece.start, piece.stop) for piece in problem.pieces])
    swing, middle = np.exp(1j * N2 * time), time - half
    slope = (problem.response - _response(theta, difference, N2 - 1e-6)) / 1e-6
    parts = np.stack([(time >= begin) * swing for begin in (0.0, 95.0, 210.0)])
    speed = np.zeros(3, dtype=complex)
    for _ in range(4):  # amplitudes and frequency are bilinear
        turning = (1j * middle * (speed @ parts)).real + slope
        columns = np.vstack([parts.real, -parts.imag, np.ones(time.size), turning])[:, used]
        prior = np.zeros((8, 4))
        if np.isfinite(steps):
            prior[[1, 2, 4, 5], range(4)] = noise / steps
        rows = np.concatenate([columns, prior], axis=1)
        data = np.concatenate([(difference - problem.response)[used], np.zeros(4)])
        solution = np.linalg.lstsq(rows.T, data, rcond=None)[0]
        speed = solution[:3] + 1j * solution[3:6]
    assert found.frequency_change == pytest.approx(solution[7], rel=5e-3)  # the slope is straight between blocks
    variance = np.linalg.inv(rows @ rows.T)[7, 7]
    assert found.noise_gain == pytest.approx(np.sqrt(variance), rel=1e-3)
    assert found.coefficient[:, 0] - 1j * found.coefficient[:, 1] == pytest.approx(np.cumsum(speed), rel=1e-4)


def _response(theta: np.ndarray, difference: np.ndarray, frequency: float) -> np.ndarray:
    problem = UniformProblem(theta, difference, 0.1, N2, 1.0001, 0.0)
    problem.respond(frequency, 0.0)
    return problem.response


def test_noise_is_not_told_from_bridges() -> None:
    """A series that lacks a third has the same noise: bridges agree with themselves, and halved it."""
    noise = np.random.default_rng(2).normal(0.0, 1e-4, 6000)
    series = 0.01 * np.cos(N2 * TIME) + noise
    series[2000:4000] = np.nan
    assert reject_outliers(series, 0.1, N2)[2] == pytest.approx(1e-4, rel=0.06)


@pytest.mark.compiled
def test_auto_takes_a_gap_of_any_length_where_pendulums_are_stated_linear() -> None:
    record, _ = simulate(duration=1000.0, motion=[SWELL, RESONANT], noise=1e-5)
    record["record"]["elongation"].values[:, 3000:7000] = np.nan
    found = row(record, "auto")
    assert abs(found["gravity_m_s2"] - GRAVITY) * 1e5 < 4.0 * found["gravity_sigma_mgal"]
