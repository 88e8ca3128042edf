"""What the problems' errors are measured against: another method, and tighter.

Linear pendulums: the closed form in many digits (mpmath). All others: Taylor integration in 80-bit arithmetic at 1e-18
(heyoka). Where heyoka is not installed, one of the project's own integrators at its tightest; the row says which.

Instants are doubles, and a swing moves by 1e-12 in an hour's last half bit of time. Propagators that count readings in
whole numbers are therefore compared at exact instants, all others at the doubles that they were given.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.benchmarks import truth
from pipeline.benchmarks.own import Answer
from pipeline.benchmarks.problems import Problem
from pipeline.benchmarks.symbolic import equations
from synth.phase import Floats
from synth.systems.dispatch import derivative

TIGHT = 1e-18
OWN_TIGHT = 1e-14
_SAMPLED = 200  # readings of which many digits are made
_BETWEEN = 400  # instants besides, closer towards the start, which show how large a component becomes


@dataclass(frozen=True)
class Reference:
    """True states at some of a problem's instants."""

    rows: NDArray[np.int64]
    """Which instants."""
    components: tuple[int, ...]
    """Which components of the state."""
    values: Floats
    """(rows, components), at the instants as doubles."""
    even: Floats
    """The same at exact instants."""
    sizes: Floats
    """Largest size of each component on the way."""
    source: str

    def error(self, problem: Problem, answer: Answer, wanted: Sequence[int]) -> float:
        """Largest error of the wanted components at any instant, over the component's largest size; NaN spreads.

        Components that one of the two sides does not know are left out.
        """
        offered = tuple(range(problem.start.size)) if answer.states.shape[1] == problem.start.size else problem.judged
        true = self.even if answer.even else self.values
        errors = []
        for place, component in enumerate(self.components):
            if component in wanted and component in offered:
                difference = answer.states[self.rows, offered.index(component)] - true[:, place]
                errors.append(np.max(np.abs(difference)) / (self.sizes[place] or 1.0))
        return float(np.max(errors))


def reference(problem: Problem) -> Reference:
    """The best reference that the installed libraries allow."""
    if problem.kind == "linear" and importlib.util.find_spec("mpmath") is not None:
        rows = np.unique(np.linspace(0, problem.count - 1, _SAMPLED).astype(np.int64))
        n, gamma = problem.system.natural_frequency, problem.system.terms.damping_rate
        true = partial(truth.linear, n, gamma, problem.start.tolist(), problem.horizontal)
        even = true([problem.step * row for row in rows.tolist()])
        values = true([Fraction(time) for time in problem.times[rows].tolist()])
        return Reference(rows, problem.judged, values, even, np.abs(even).max(axis=0), "mpmath, 100 digits")
    times = problem.times
    span = times[-1] - times[0]
    more = np.union1d(times, times[0] + span * np.logspace(-7.0, 0.0, _BETWEEN, endpoint=False))
    if importlib.util.find_spec("heyoka") is not None:
        states, source = in_eighty_bits(problem, more), f"heyoka, 80 bits, {TIGHT:g}"
    else:
        states, source = _own(problem, more)
    values = states[np.searchsorted(more, times)]
    rows, components = np.arange(times.size), tuple(range(problem.start.size))
    return Reference(rows, components, values, _at_exact_instants(problem, values), np.abs(states).max(axis=0), source)


def in_eighty_bits(problem: Problem, times: Floats) -> Floats:
    """States (k, n) by Taylor integration with `numpy.longdouble`."""
    import heyoka as hy

    wide = np.longdouble
    integrator = hy.taylor_adaptive(
        equations(problem, wide),
        problem.start.astype(wide),
        time=wide(times[0]),
        tol=wide(TIGHT),
        fp_type=wide,
        compact_mode=True,  # a minute of compiling less
    )
    outcome, *_, states = integrator.propagate_grid(times.astype(wide))
    if outcome != hy.taylor_outcome.time_limit:
        raise RefusedError(f"heyoka, 80 bits: {outcome}")
    return np.asarray(states, dtype=np.float64)


def _own(problem: Problem, times: Floats) -> tuple[Floats, str]:
    name = "radau" if problem.stiff else "explicit"
    integrate = import_module(f"synth.integrators.{name}").integrate
    states = integrate(problem.system, problem.start, times, tolerance=OWN_TIGHT).states
    return states, f"own {name}, {OWN_TIGHT:g}: no reference for itself"


def _at_exact_instants(problem: Problem, values: Floats) -> Floats:
    """States moved along the motion from instants as doubles to exact ones."""
    moved, slope = values.copy(), np.empty(problem.start.size)
    for k, time in enumerate(problem.times.tolist()):
        derivative(time, values[k], problem.system, slope)
        moved[k] += float(problem.step * k - Fraction(time)) * slope
    return moved
