"""Work against error for each way to the paper's regime; what a member of the lock map costs, and costs libraries."""

from __future__ import annotations

import importlib.util
import math
import statistics
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from pipeline.benchmarks import huygens_map
from pipeline.benchmarks.huygens_curves import DRIVE, clocks_of, moved, nearest
from pipeline.benchmarks.peers import compiled_right_side
from pipeline.benchmarks.work_precision import cpu, timed
from synth.huygens.balance import Regime
from synth.huygens.clocks import Clocks
from synth.huygens.offset import orbit_slope, slope
from synth.huygens.orbit import orbit
from synth.huygens.paper import COUPLING, corrected, printed
from synth.integrators.collocation_ensemble import integrate_ensemble
from synth.phase import Floats
from synth.systems.reduced_beam import ReducedBeam

Row = dict[str, Any]
ALPHA = -0.5
_STEPS = (8, 12, 16, 24, 32, 48)
_TRUE_STEPS = 192
_SWINGS = (100, 200, 400, 800)
_REPEATS = 5
_MEMBERS, _QUICK_MEMBERS = 64, 4  # a row of the lock map
_TOLERANCE = 1e-7  # the lock map's


def rows(*, quick: bool) -> Iterator[Row]:
    """One row a way and setting: errors of beta and k against the orbit in 192 steps, and warm CPU time."""
    chain = corrected(ALPHA, DRIVE)
    clocks = clocks_of(chain)
    regime = nearest(clocks, ALPHA)
    true = orbit(regime, clocks, steps=_TRUE_STEPS).regime.beta
    true_slope = orbit_slope(regime, clocks)
    repeats = 1 if quick else _REPEATS

    def row(way: str, setting: str, beta: Callable[[], float], k: float) -> Row:
        found = beta()
        spent = statistics.median(cpu(beta) for _ in range(repeats))
        apart = abs(k / true_slope - 1.0)
        return {"work": way, "setting": setting, "beta_error": abs(found - true), "k_error": apart, "ms": 1e3 * spent}

    yield row("paper", "", lambda: float(printed(ALPHA).beta), float(printed(ALPHA).slope))
    yield row("corrected chain", "", lambda: float(corrected(ALPHA, DRIVE).beta), float(chain.slope))
    yield row("balance", "", lambda: nearest(clocks, ALPHA).beta, slope(regime, clocks, shifts=True))
    for steps in _STEPS:
        yield row("orbit", f"{steps} steps", partial(_beta_of_orbit, regime, clocks, steps), math.nan)
    for swings in _SWINGS:
        yield row("motion", f"{swings} swings", partial(_beta_of_motion, regime, clocks, swings), math.nan)


def _beta_of_orbit(regime: Regime, clocks: Clocks, steps: int) -> float:
    return orbit(regime, clocks, steps=steps).regime.beta


def _beta_of_motion(regime: Regime, clocks: Clocks, swings: int) -> float:
    return moved(regime, clocks, swings).beta


def member_rows(*, quick: bool) -> Iterator[Row]:
    """What a member of the lock map costs, 2,000 swings at the same tolerance; errors against 1e-12."""
    count = _QUICK_MEMBERS if quick else _MEMBERS
    chis = np.linspace(0.0, huygens_map.MOST_CHI, count + 1)[1:]
    systems = [Clocks(0.02, 0.02, COUPLING, (0.0, 0.0)).detuned(chi).small() for chi in chis.tolist()]
    start = np.array([0.0, 0.0, 2.0, 0.0, 0.2, 1.98])
    times = np.linspace(0.0, 2.0 * math.pi * huygens_map.SWINGS, 201)
    starts = np.tile(start, (count, 1))
    few = min(count, 4)  # of whom the slow ones are asked

    def own(tolerance: float = _TOLERANCE) -> Floats:
        return integrate_ensemble(systems, starts, times, tolerance=tolerance, workers=1)

    true = own(1e-12)
    own()  # compiled
    ways: dict[str, tuple[int, Callable[[], Floats]]] = {"own ensemble": (count, own)}
    ways["scipy DOP853"] = (few, lambda: np.array([_by_scipy(each, start, times) for each in systems[:few]]))
    if importlib.util.find_spec("heyoka") is not None:
        ways["heyoka, batch"] = (count, _by_heyoka(systems, start, times))
    costs: dict[str, float] = {}
    for way, (members, call) in ways.items():
        states, spent = timed(call)
        costs[way] = spent / members
        yield {
            "member": way,
            "members": members,
            "tolerance": _TOLERANCE,
            "error": float(np.abs(states[:, :, 2::2] - true[:members, :, 2::2]).max()),
            "ms_a_member": 1e3 * costs[way],
            "times_own": costs[way] / costs["own ensemble"],
        }


def _by_scipy(system: ReducedBeam, start: Floats, times: Floats) -> Floats:
    from scipy.integrate import solve_ivp

    right = compiled_right_side(system)

    def slopes(moment: float, state: Floats) -> Floats:
        out = np.empty(state.size)
        right(moment, state, out)
        return out

    solve: Any = solve_ivp  # whose stubs want to know the method beforehand
    span = (float(times[0]), float(times[-1]))
    return np.asarray(solve(slopes, span, start, "DOP853", times, rtol=_TOLERANCE, atol=_TOLERANCE).y).T


def _by_heyoka(systems: list[ReducedBeam], start: Floats, times: Floats) -> Callable[[], Floats]:
    """As many members at a time as fill a vector register; detunings are parameters."""
    import heyoka as hy

    width = int(hy.recommended_simd_size())
    detunings = np.array([each.detuning for each in systems])
    detunings = np.vstack([detunings, np.tile(detunings[-1], (-len(systems) % width, 1))])
    integrator = hy.taylor_adaptive_batch(
        _formulas(systems[0]), np.tile(start[:, None], (1, width)), tol=_TOLERANCE, compact_mode=False,
        pars=np.ascontiguousarray(detunings[:width].T),
    )  # fmt: skip
    grid = np.repeat(times[:, None], width, axis=1)

    def call() -> Floats:
        found = np.empty((len(detunings), times.size, start.size))
        for first in range(0, len(detunings), width):
            integrator.set_time(0.0)
            integrator.state[:] = start[:, None]
            integrator.pars[:] = detunings[first : first + width].T
            states = integrator.propagate_grid(grid)
            found[first : first + width] = np.moveaxis(
                np.asarray(states[-1] if isinstance(states, tuple) else states), 2, 0
            )
        return found[: len(systems)]

    return call


def _formulas(system: ReducedBeam) -> list[tuple[Any, Any]]:
    """System (2) solved for its accelerations; tau_i are parameters 0 and 1."""
    import heyoka as hy

    u, speed = hy.make_vars("u", "v")
    inertia, force, swings = 1.0, 0.0, []
    for k in (0, 1):
        y, rate = hy.make_vars(f"y{k}", f"r{k}")
        free = system.drive * (1.0 - y * y) * rate - (1.0 + hy.par[k]) * y
        inertia = inertia - 2.0 * system.coupling * y * y
        force = force + rate * rate + y * free
        swings.append((y, rate, free))
    beam = (2.0 * system.coupling * force - 2.0 * system.beam_damping * speed - 4.0 * u) / inertia
    found = [(u, speed), (speed, beam)]
    for y, rate, free in swings:
        found += [(y, rate), (rate, free + beam * y)]
    return found
