"""General integrators on the problems, each by its fastest face.

Every right-hand side is compiled by Numba (heyoka's from formulas); Jacobians are given to whoever takes them. None of
these libraries is needed to use the package; they are the extra `peers`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.benchmarks.problems import Problem
from pipeline.benchmarks.references import equations
from synth.phase import Floats
from synth.systems.dispatch import derivative, jacobian

Call = Callable[[], Floats]
"""One integration from start to end: states (k, n)."""
ABSOLUTE = 1e-3
"""Absolute tolerance over the relative one: angles are of 0.01 to 1 rad."""


class Peer(NamedTuple):
    """A way to call a library: its name to import, and (problem, tolerance) -> call, compiling done.

    `stiff`: sensible for stiff problems alone, for others alone, or for both (None).
    """

    library: str
    make: Callable[[Problem, float], Call]
    stiff: bool | None


def heyoka(problem: Problem, tolerance: float) -> Call:
    """Adaptive Taylor integration, non-compact mode, in double."""
    import heyoka as hy

    start, times = problem.start, problem.times
    integrator = hy.taylor_adaptive(equations(problem, float), start, tol=tolerance, compact_mode=False)

    def call() -> Floats:
        integrator.time = times[0]
        integrator.state[:] = start
        outcome, *_, states = integrator.propagate_grid(times)
        if outcome != hy.taylor_outcome.time_limit:
            raise RefusedError(f"heyoka: {outcome}")
        return np.asarray(states)

    return call


def cyrk(problem: Problem, tolerance: float, method: str) -> Call:
    """CyRK called from compiled code with a C callback: its fastest face."""
    from CyRK import cyjit, nbsolve2_ivp
    from numba import carray  # type: ignore[attr-defined]  # its stubs forget it

    system, size = problem.system, problem.start.size

    def slopes(out: Any, time: float, state: Any, parameters: Any) -> None:
        derivative(time, carray(state, size), system, carray(out, size))

    compiled = cyjit(slopes)
    start, times = problem.start, problem.times
    span, tolerances = (float(times[0]), float(times[-1])), {"rtol": tolerance, "atol": ABSOLUTE * tolerance}

    def call() -> Floats:
        assert compiled.address  # keeps the callback alive
        found = nbsolve2_ivp(compiled.address, span, start, method, times, **tolerances)
        good, states = bool(found.success), np.array(found.y).T.copy()
        found.free()
        if not good or states.shape[0] != times.size:
            raise RefusedError(f"CyRK {method}: it says that it did not succeed")
        return states

    return call


def scipy(problem: Problem, tolerance: float, method: str) -> Call:
    """scipy's `solve_ivp`."""
    from numba import njit
    from scipy.integrate import solve_ivp

    integrate: Any = solve_ivp  # whose stubs want to know the method beforehand
    system, size = problem.system, problem.start.size

    def slopes(time: float, state: Floats) -> Floats:
        out = np.empty(size)
        derivative(time, state, system, out)
        return out

    def matrix(time: float, state: Floats) -> Floats:
        out = np.empty((size, size))
        jacobian(time, state, system, out)
        return out

    right: Any = njit(slopes)
    options: dict[str, Any] = {"rtol": max(tolerance, 1e-13), "atol": ABSOLUTE * tolerance}
    options |= {"jac": njit(matrix)} if problem.stiff else {}
    span = (float(problem.times[0]), float(problem.times[-1]))

    def call() -> Floats:
        found: Any = integrate(right, span, problem.start, method, problem.times, **options)
        if not found.success:
            raise RefusedError(f"scipy {method}: {found.message}")
        return np.asarray(found.y).T

    return call


PEERS: Mapping[str, Peer] = {
    "heyoka": Peer("heyoka", heyoka, None),
    "CyRK DOP853": Peer("CyRK", partial(cyrk, method="DOP853"), False),
    "CyRK RADAU": Peer("CyRK", partial(cyrk, method="RADAU"), True),
    "scipy DOP853": Peer("scipy", partial(scipy, method="DOP853"), False),
    "scipy Radau": Peer("scipy", partial(scipy, method="Radau"), True),
}
"""All of them, by the names under which rows and pictures show them."""
