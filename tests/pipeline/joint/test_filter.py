"""Filter, smoother and derivatives: against one dense Gaussian, and against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm, logm

from pipeline.joint import kinds
from pipeline.joint.constants import Constant, starts
from pipeline.joint.lattice import lay
from pipeline.joint.problem import Assumed, Problem
from pipeline.joint.ship import Sea, Ship, Vibration

KAPPA = np.array([38.7, 38.6])
COMBINATION = np.array([[1.0, 0.0], [1.0, -1.0]])
STEP = 0.04


def problem(nodes: int = 30, jitter: float = 0.0, lost: tuple[int, ...] = ()) -> Problem:
    rng = np.random.default_rng(5)
    time = STEP * np.arange(nodes) + jitter * STEP * rng.uniform(-0.5, 0.5, nodes)
    time[[0, -1]] = STEP * 0, STEP * (nodes - 1)
    swing = 0.02 * np.cos(6.2 * time) + 1e-3 * rng.normal(size=nodes)
    series = np.stack([swing, 0.7 * swing + 1e-3 * rng.normal(size=nodes)])
    series[0, list(lost)] = np.nan
    return Problem(lay(time, series, COMBINATION, 6.2), KAPPA, np.array([1e-3, 2e-3]))


def assumed(sine: bool = False) -> Assumed:
    ship = (Sea(0.7, 0.3, 0.02), Vibration(6.0, 1e-2))
    return Assumed(ship, np.array([1e-3, 2e-3]), np.array([1e-3, 2e-3, 1.0, 1.0]), sine)


def constants() -> tuple[Constant, ...]:
    begun = starts(2, np.sqrt(KAPPA), np.array([0.02, 0.0, 0.005, 0.01]))
    return (*begun, Constant("gravity", kinds.GRAVITY, 0.01, mean=1.0, value=1.0))


def dense(of: Problem, model: Assumed) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Mean and covariance of all states, rows of all readings, and their values, from the flow's matrices alone."""
    ship = Ship.of(model.ship)
    step = of.flow(model, constants())
    size = step.noise.shape[0]
    transition, nodes = step.ahead, of.lattice.nodes
    drift = logm(transition).real / of.lattice.step
    start = np.zeros((size, size))
    start[4:, 4:] = ship.stationary
    for each in starts(2, np.sqrt(KAPPA)):
        start[each.index, each.index] = each.prior**2
    covariance = np.zeros((nodes * size, nodes * size))
    here = start
    for k in range(nodes):
        rows = slice(k * size, (k + 1) * size)
        covariance[rows, rows] = here
        for j in range(k + 1, nodes):
            before, now = slice((j - 1) * size, j * size), slice(j * size, (j + 1) * size)
            covariance[now, rows] = transition @ covariance[before, rows]
            covariance[rows, now] = covariance[now, rows].T
        here = transition @ here @ transition.T + step.noise
    lattice = of.lattice
    rows = np.zeros((lattice.node.size, nodes * size))
    for r, (node, trace) in enumerate(zip(lattice.node, lattice.trace, strict=True)):
        rows[r, node * size : (node + 1) * size] = COMBINATION[trace] @ expm(drift * lattice.offset[r])[:4:2]
    return covariance, rows, lattice.value, model.noise[lattice.trace] ** 2


@pytest.mark.parametrize("lost", [(), (3, 4, 5, 6, 20)])
def test_likelihood_and_path_are_those_of_one_dense_gaussian(lost: tuple[int, ...]) -> None:
    of, model = problem(12, lost=tuple(k for k in lost if k < 12)), assumed()
    covariance, rows, value, noise = dense(of, model)
    of_readings = rows @ covariance @ rows.T + np.diag(noise)
    expected = -0.5 * value @ np.linalg.solve(of_readings, value)
    expected -= 0.5 * np.linalg.slogdet(2.0 * np.pi * of_readings)[1]
    at_zero = tuple(replace(each, value=0.0) for each in starts(2, np.sqrt(KAPPA)))
    held = (*at_zero, Constant("gravity", kinds.GRAVITY, 1e-12, mean=1.0, value=1.0))
    solution, _ = of.run(model, held)
    assert solution.log_likelihood == pytest.approx(expected, abs=1e-6)
    _, _, path = of.fit(model, solution.constants)
    mean = (covariance @ rows.T @ np.linalg.solve(of_readings, value)).reshape(of.lattice.nodes, -1)
    assert np.abs(path[:, :4] - mean[:, :4]).max() < 1e-8


@pytest.mark.parametrize("sine", [False, True])
@pytest.mark.parametrize(
    "constant",
    [
        Constant("gravity", kinds.GRAVITY, 1.0, value=1.0),
        Constant("hat", kinds.GRAVITY, 1.0, centre=0.5, width=0.4),
        Constant("damping", kinds.DAMPING, 1.0),
        Constant("quadratic", kinds.QUADRATIC, 1.0, value=0.01),
        Constant("zero", kinds.ZERO, 1.0, index=1),
        Constant("drift", kinds.DRIFT, 1.0, index=0, centre=0.4, width=0.8),
        Constant("gain", kinds.GAIN, 1.0, index=0),
        Constant("step", kinds.STEP, 1.0, index=1, centre=0.5),
        Constant("start", kinds.START, 1.0, index=1, value=0.01),
        Constant("delay", kinds.DELAY, 1.0, index=1),
        Constant("clock", kinds.CLOCK, 1.0, centre=0.5),
        Constant("ratio", kinds.RATIO, 1.0, index=1),
        Constant("knock", kinds.KNOCK, 1.0, index=1, value=0.01, centre=0.5),
        Constant("dry", kinds.DRY, 1.0, value=1e-3, centre=0.02),
        Constant("fade", kinds.FADE, 1.0, value=0.02),
    ],
    ids=lambda constant: constant.name,
)
def test_derivatives_are_those_of_the_prediction_errors(constant: Constant, sine: bool) -> None:
    # readings that say next to nothing keep the gain at nought: a difference would change it too; over some seconds
    # what a constant does between a node and its readings, which is left out, is nothing beside what it has done
    of, model = problem(180), replace(assumed(sine), noise=np.array([1e4, 2e4, 1.0, 1.0]))
    plain = tuple(each for each in constants() if (each.kind, each.index) != (constant.kind, constant.index))
    if constant.name == "hat":
        plain = constants()
    if constant.name == "fade":
        plain = (*plain, Constant("dry", kinds.DRY, 1.0, value=1e-3))
    whole = (*plain, constant)

    def errors(value: float) -> np.ndarray:
        moved = (*plain, replace(constant, value=value))
        return np.asarray(of.run(model, moved)[1].whitened)

    by = 1e-5
    slope = (errors(constant.value + by) - errors(constant.value - by)) / (2.0 * by)
    here = errors(constant.value)
    normal = of.run(model, whole)[1].normal
    at = len(whole) - 1
    # a gain here divides the readings, which scales the error as well; a clock's step takes the speed at the node
    rel = {kinds.GAIN: 0.1, kinds.CLOCK: 5e-3}.get(constant.kind, 2e-3)
    assert normal[at, at] == pytest.approx(slope @ slope, rel=rel)
    if constant.kind != kinds.GAIN:
        assert normal[at, -1] == pytest.approx(slope @ here, rel=rel, abs=rel * np.sqrt(slope @ slope))


@pytest.mark.parametrize("size", [0.2, 1.0, 5.0])
def test_the_scale_of_one_trace_is_not_told_from_a_ship_of_another_size(size: float) -> None:
    rng = np.random.default_rng(3)
    time = STEP * np.arange(2000)
    value = 1e-3 * np.cumsum(rng.normal(size=2000)) + 0.02 * np.cos(6.2 * time)
    of = Problem(lay(time, value[None], np.array([[1.0]]), 6.2), KAPPA[:1], np.array([1e-3]))
    model = Assumed((Sea(0.7, 0.3, 0.02 * size), Vibration(6.0, 1e-2 * size)), np.zeros(1), np.full(3, 1e-3), False)
    gravity, gain = Constant("gravity", kinds.GRAVITY, 1e-9, mean=1.0, value=1.0), Constant("gain", kinds.GAIN, 0.01)
    solution, _ = of.run(model, (*starts(1, np.sqrt(KAPPA[:1]), arc=1e3), gravity, gain))
    assert solution.sigma("gain") == pytest.approx(0.01, rel=1e-6)
    assert solution.constants[-1].value == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("breaks", [(), ((11, 0), (11, 1), (20, 1))])
@pytest.mark.parametrize("heave_noise", [0.0, 1e-3])
def test_a_path_does_not_depend_on_how_much_is_kept_at_once(
    breaks: tuple[tuple[int, int], ...], heave_noise: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    of, model = problem(lost=(3, 4, 5)), replace(assumed(sine=True), breaks=breaks, heave_noise=heave_noise)
    whole = of.fit(model, constants())
    monkeypatch.setattr("pipeline.joint.problem.KEPT", 20_000)
    parts = of.fit(model, constants())
    np.testing.assert_allclose(parts[2], whole[2], rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose(parts[1].whitened, whole[1].whitened, rtol=1e-7, atol=1e-9)


def test_errors_at_the_solution_do_not_depend_on_how_much_is_kept_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """What does not fit is gone through once more at the solution, without derivatives; kept, it is extrapolated."""
    of, model = problem(lost=(3, 4, 5)), assumed()
    knock = Constant("knock", kinds.KNOCK, 1e-3, index=1, mean=0.02, value=0.02, centre=0.5)
    whole = of.fit(model, (*constants(), knock), smooth=False)
    monkeypatch.setattr("pipeline.joint.problem.KEPT", 1000)
    again = of.fit(model, (*constants(), knock), smooth=False)
    before = of.run(model, (*constants(), knock))[1].whitened
    assert np.nanmax(np.abs(before - whole[1].whitened)) > 1.0
    assert again[0].step == pytest.approx(whole[0].step, rel=1e-6)
    np.testing.assert_allclose(again[1].whitened, whole[1].whitened, atol=0.02)


@pytest.mark.parametrize("breaks", [(), ((2, 0), (4, 1))])
def test_a_smoothed_path_is_where_the_likelihood_of_one_more_reading_is_greatest(
    breaks: tuple[tuple[int, int], ...],
) -> None:
    of, model = problem(lost=(7,)), replace(assumed(sine=True), breaks=breaks, heave_noise=1e-3)
    held = tuple(replace(each, prior=1e-9, mean=each.value) for each in constants())
    about = of.fit(model, held)[2]
    path = of.fit(model, held, about=about)[2]

    def likelihood(angle: float) -> float:
        lattice = of.lattice
        at = int(np.searchsorted(lattice.node, 3))
        added = replace(
            lattice,
            node=np.insert(lattice.node, at, 3),
            trace=np.insert(lattice.trace, at, 0),
            offset=np.insert(lattice.offset, at, 0.0),
            value=np.insert(lattice.value, at, angle),
        )
        return replace(of, lattice=added).run(model, held, about=about)[0].log_likelihood

    here, by = float(path[3, 0]), 1e-3
    low, mid, high = (likelihood(here + k * by) for k in (-1.0, 0.0, 1.0))
    assert mid > max(low, high)
    assert abs(low - high) < 1e-6 * (2.0 * mid - low - high)


def test_readings_off_the_nodes_cost_nothing() -> None:
    rng = np.random.default_rng(2)
    fine = np.arange(0.0, 4.0, 0.005)
    angle = 0.02 * np.cos(np.sqrt(KAPPA[0]) * fine)
    some = np.append(0, np.sort(rng.choice(np.arange(1, fine.size), 200, replace=False)))
    lattice = lay(fine[some], np.stack([angle[some]]), np.array([[1.0]]), 6.2)
    of = Problem(lattice, KAPPA[:1], np.zeros(1))
    model = Assumed((Vibration(6.0, 1e-9),), np.zeros(1), np.array([1e-7, 1.0, 1.0]), sine=False)
    turn = np.sqrt(KAPPA[0]) * lattice.start
    begun = starts(1, np.sqrt(KAPPA[:1]), 0.02 * np.array([np.cos(turn), -np.sqrt(KAPPA[0]) * np.sin(turn)]))
    _, done = of.run(model, (*begun, Constant("gravity", kinds.GRAVITY, 1e-9, mean=1.0, value=1.0)))
    assert np.nanmax(np.abs(done.whitened)) < 0.05  # 5e-9 rad


def test_a_reading_over_the_gate_is_left_out() -> None:
    of, model = problem(), assumed()
    of.lattice.value[20] += 1.0
    _, done = of.run(model, constants(), gate=20.0)
    assert np.isnan(done.whitened[20])
    assert np.isfinite(np.delete(done.whitened, 20)).all()


def long(jitter: float, kick: float, nodes: int = 20_000) -> tuple[Problem, Assumed]:
    """Readings at times that are off by some share of their step, and what is assumed of them."""
    rng = np.random.default_rng(5)
    time = STEP * np.arange(nodes)
    time[1:-1] += jitter * STEP * rng.uniform(-0.5, 0.5, time.size - 2)
    swing = 0.02 * np.cos(6.2 * time) + 2e-4 * rng.normal(size=time.size)
    series = np.stack([swing, 0.7 * swing + 2e-4 * rng.normal(size=time.size)])
    of = Problem(lay(time, series, COMBINATION, 6.2), KAPPA, np.array([1e-3, 2e-3]))
    return of, replace(assumed(), kick=np.full(2, kick), noise=np.array([2e-4, 2e-4, 1.0, 1.0]))


@pytest.mark.compiled
@pytest.mark.parametrize("kick", [0.0, 1e-6, 1e-5])
def test_a_gain_is_kept_where_it_settles_though_it_crawls_there(kick: float) -> None:
    """At uneven times no gain is kept: sigma would be half as large were the crawling one."""
    even, uneven = (of.run(model, constants())[0].sigma("gravity") for of, model in (long(0.0, kick), long(1e-4, kick)))
    assert even == pytest.approx(uneven, rel=0.03)


@pytest.mark.compiled
def test_what_kicks_made_the_filter_forget_is_gone() -> None:
    """The start's derivatives die out; numbers too small to be normal would take ten times as long."""
    of, model = long(0.0, 1e-3, 60_000)
    state = np.abs(of.run(model, constants())[1].state)
    assert np.all((state == 0.0) | (state > 1e-200))
    assert not state[:, :4].any()
