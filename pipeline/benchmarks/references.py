"""What the problems' errors are measured against: another method, and tighter.

Linear pendulums: the closed form in many digits (mpmath). All others: Taylor integration in 80-bit arithmetic at 1e-18
(heyoka). Where heyoka is not installed, one of the project's own integrators at its tightest; the row says which.

A swing moves by 1e-12 in an hour's last half bit of time: answers are compared at those readings alone whose instants
are doubles exactly, every fifth of those at 20 a second. Equations are given to heyoka in numbers of the integration's
arithmetic, so that a double stays the number it is.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.benchmarks.problems import GRAVITY, Answer, Problem, Swell
from synth.phase import Floats
from synth.systems.driven_pendulums import DrivenPendulums, Sine
from synth.systems.yielding import ElasticBeam

Number = Callable[[Any], Any]
Equations = list[tuple[Any, Any]]
Instants = Sequence[Fraction]
TIGHT = 1e-18
OWN_TIGHT = 1e-14
_SAMPLED = 200  # readings of which many digits are made
_BETWEEN = 400  # instants besides, closer towards the start, which show how large a component becomes


def linear(
    frequency: Iterable[float], damping: Iterable[float], start: Sequence[float], swell: Swell, instants: Instants
) -> Floats:
    """Linear pendulums under harmonics, however damped, at resonance too; (instants, pendulums), rad.

    Resonance and critical damping are approached to 1e-40 in 100 digits, which is their limit to 40.
    """
    mpmath: Any = import_module("mpmath")
    mp, mpf, mpc = mpmath.mp, mpmath.mpf, mpmath.mpc
    found = np.empty((len(instants), len(start) // 2))
    with mp.workdps(100):
        for k, (n, each) in enumerate(zip(frequency, damping, strict=True)):
            square, gamma = mpf(float(n)) ** 2 * (1 + mpf(10) ** -40), mpf(float(each))
            root = mp.sqrt(mpc(gamma**2 - square))
            fast, slow = -gamma - root, -gamma + root
            steady = []
            for a, w, p in zip(*swell, strict=True):
                rate = mpf(float(w))
                drive = -(mpf(float(n)) ** 2) * mpf(float(a)) / mpf(GRAVITY) * mp.expj(mpf(float(p)))
                steady.append((rate, drive / (square - rate * rate + mpc(0, 2) * gamma * rate)))
            angle = mpf(float(start[2 * k])) - mp.fsum(c.real for _, c in steady)
            speed = mpf(float(start[2 * k + 1])) - mp.fsum((mpc(0, w) * c).real for w, c in steady)
            one = (speed - slow * angle) / (fast - slow)
            for row, instant in enumerate(instants):
                t = mpf(instant.numerator) / instant.denominator
                free = (one * mp.exp(fast * t) + (angle - one) * mp.exp(slow * t)).real
                found[row, k] = float(free + mp.fsum((c * mp.expj(w * t)).real for w, c in steady))
    return found


def swing(frequency: float, amplitude: float, instants: Instants) -> Floats:
    """A pendulum released at rest: `sin(theta/2) = k cd(n t, k)`; (instants, 1), rad."""
    mpmath: Any = import_module("mpmath")
    with mpmath.mp.workdps(40):
        modulus, n = mpmath.sin(mpmath.mpf(float(amplitude)) / 2), mpmath.mpf(float(frequency))
        times = [mpmath.mpf(each.numerator) / each.denominator for each in instants]
        values = [2 * mpmath.asin(modulus * mpmath.ellipfun("cd", n * t, m=modulus**2)) for t in times]
        return np.array([[float(value)] for value in values])


def separatrix(frequency: float, instants: Instants) -> Floats:
    """Through the bottom with 2 n exactly: `4 atan(tanh(n t/2))`, towards the top for ever; (instants, 1), rad."""
    times = np.array([float(each) for each in instants])
    return 4.0 * np.arctan(np.tanh(0.5 * frequency * times))[:, None]


def equations(problem: Problem, number: Number) -> Equations:
    """Pairs (variable, derivative) in the order of the state; `ImportError` where heyoka is not installed.

    `number` makes a number of the arithmetic wanted, `float` or `numpy.longdouble`.
    """
    import heyoka as hy

    system = problem.system
    if isinstance(system, DrivenPendulums):
        return _pendulums(problem, number)
    if isinstance(system, ElasticBeam):
        return _beam(system, number)
    y, v = hy.make_vars("y", "v")  # van der Pol's
    return [(y, v), (v, number(system.stiffness) * (number(1.0) - y * y) * v - y)]


def _level(motion: Swell, number: Number) -> Any:
    import heyoka as hy

    terms = [number(a) * hy.cos(number(w) * hy.time + number(p)) for a, w, p in zip(*motion, strict=True) if a]
    return hy.sum(terms) if terms else None


def _pendulums(problem: Problem, number: Number) -> Equations:
    import heyoka as hy

    system = problem.system
    across, along = _level(problem.horizontal, number), _level(problem.vertical, number)
    sine, gravity = isinstance(system.restoring, Sine), number(system.gravity)
    found: Equations = []
    for k, (n, gamma) in enumerate(zip(system.natural_frequency, system.terms.damping_rate, strict=True)):
        x, v = hy.make_vars(f"x{k}", f"v{k}")
        back = hy.sin(x) if sine else x
        if along is not None:
            back = (number(1.0) + along / gravity) * back
        if across is not None:
            back = back + across / gravity * (hy.cos(x) if sine else number(1.0))
        found += [(x, v), (v, -number(2.0) * number(gamma) * v - number(n) * number(n) * back)]
    return found


def _beam(system: ElasticBeam, number: Number) -> Equations:
    """System (1) of Kanunnikov and Lamper, solved for the accelerations."""
    import heyoka as hy

    x, v = hy.make_vars("x", "v")
    gravity, heavy = number(system.gravity), number(system.beam_mass)
    whole, inertia = heavy, heavy
    force: Any = number(0.0)
    swings = []
    for k, (m, length) in enumerate(zip(system.mass, system.length, strict=True)):
        angle, rate = hy.make_vars(f"phi{k}", f"rate{k}")
        sine, cosine = hy.sin(angle), hy.cos(angle)
        free = -(gravity / number(length)) * sine
        if system.terms is not None:
            share = angle / number(system.terms.angle[k])
            free = free + number(system.terms.rate[k]) * (number(1.0) - share * share) * rate
        whole = whole + number(m)
        inertia = inertia + number(m) * cosine * cosine
        force = force + number(m) * number(length) * (cosine * rate * rate + sine * free)
        swings.append((angle, rate, sine, free, number(length)))
    pull = force - number(system.stiffness) * x - whole * number(system.damping_rate) * v
    beam = pull / inertia
    found: Equations = [(x, v), (v, beam)]
    for angle, rate, sine, free, length in swings:
        found += [(angle, rate), (rate, free + sine * beam / length)]
    return found


@dataclass(frozen=True)
class Reference:
    """True states at some of a problem's instants."""

    rows: NDArray[np.int64]  # which instants
    components: tuple[int, ...]  # which components of the state
    values: Floats  # (rows, components)
    sizes: Floats  # largest size of each component on the way
    source: str

    def error(self, problem: Problem, answer: Answer, wanted: Sequence[int]) -> float:
        """Largest error of the wanted components at any instant, over the component's largest size; NaN spreads.

        Components that one of the two sides does not know are left out.
        """
        offered = tuple(range(problem.start.size)) if answer.states.shape[1] == problem.start.size else problem.judged
        errors = []
        for place, component in enumerate(self.components):
            if component in wanted and component in offered:
                difference = answer.states[self.rows, offered.index(component)] - self.values[:, place]
                errors.append(np.max(np.abs(difference)) / (self.sizes[place] or 1.0))
        return float(np.max(errors))


def reference(problem: Problem) -> Reference:
    """The best reference that the installed libraries allow."""
    instants = [problem.step * k for k in range(problem.count)]
    rows = np.array([k for k, instant in enumerate(instants) if Fraction(float(instant)) == instant])
    if problem.kind == "linear" and importlib.util.find_spec("mpmath") is not None:
        rows = rows[np.unique(np.linspace(0, rows.size - 1, _SAMPLED).astype(np.int64))]
        n, gamma = problem.system.natural_frequency, problem.system.terms.damping_rate
        values = linear(n, gamma, problem.start.tolist(), problem.horizontal, [instants[row] for row in rows])
        return Reference(rows, problem.judged, values, np.abs(values).max(axis=0), "mpmath, 100 digits")
    times = problem.times[rows]
    more = np.union1d(times, times[0] + np.ptp(times) * np.logspace(-7.0, 0.0, _BETWEEN, endpoint=False))
    if importlib.util.find_spec("heyoka") is not None:
        # compact: a minute of compiling less
        states = taylor(problem, more, TIGHT, np.longdouble, compact_mode=True)()
        source = f"heyoka, 80 bits, {TIGHT:g}"
    else:
        name = "radau" if problem.stiff else "explicit"
        integrate = import_module(f"synth.integrators.{name}").integrate
        states = integrate(problem.system, problem.start, more, tolerance=OWN_TIGHT).states
        source = f"own {name}, {OWN_TIGHT:g}: no reference for itself"
    values = states[np.searchsorted(more, times)]
    return Reference(rows, tuple(range(problem.start.size)), values, np.abs(states).max(axis=0), source)


def taylor(problem: Problem, times: Floats, tolerance: float, number: Any, **options: Any) -> Callable[[], Floats]:
    """A call that gives states (k, n) by heyoka's Taylor integration in the arithmetic of a type of number."""
    import heyoka as hy

    start, instants = problem.start.astype(number), times.astype(number)
    integrator = hy.taylor_adaptive(equations(problem, number), start, tol=number(tolerance), fp_type=number, **options)

    def call() -> Floats:
        integrator.time = instants[0]
        integrator.state[:] = start
        outcome, *_, states = integrator.propagate_grid(instants)
        if outcome != hy.taylor_outcome.time_limit:
            raise RefusedError(f"heyoka{'' if number is float else ', 80 bits'}: {outcome}")
        return np.asarray(states, dtype=np.float64)

    return call
