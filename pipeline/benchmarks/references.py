"""What the problems' errors are measured against: another method, and tighter.

Extreme motions: closed forms in many digits (mpmath). Problems of integrators: Taylor integration in 80-bit arithmetic
at 1e-18 (heyoka), or an own integrator at its tightest where heyoka is not installed; the row says which. A swing moves
by 1e-12 in an hour's last half bit of time: answers are compared where instants are doubles exactly.
"""

import importlib.util
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.benchmarks.problems import GRAVITY, Problem, Swell
from synth.phase import Floats
from synth.systems.driven_pendulums import DrivenPendulums, Sine
from synth.systems.yielding import ElasticBeam

Equations = list[tuple[Any, Any]]
Instants = Sequence[Fraction]
Number: Any = np.longdouble
TIGHT = 1e-18
OWN_TIGHT = 1e-14
_BETWEEN = 400  # instants besides, closer towards the start, which show how large a component becomes


def linear(
    frequency: Iterable[float], damping: Iterable[float], start: Sequence[float], swell: Swell, instants: Instants
) -> Floats:
    """Linear pendulums under harmonics, however damped, (instants, pendulums), rad; resonance and critical damping are
    approached to 1e-40 in 100 digits, which is their limit to 40."""
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


def equations(problem: Problem) -> Equations:
    """Pairs (variable, derivative) in the order of the state; `ImportError` where heyoka is not installed."""
    import heyoka as hy

    system = problem.system
    if isinstance(system, DrivenPendulums):
        return _pendulums(problem)
    if isinstance(system, ElasticBeam):
        return _beam(system)
    y, v = hy.make_vars("y", "v")  # van der Pol's
    return [(y, v), (v, Number(system.stiffness) * (1.0 - y * y) * v - y)]


def _pendulums(problem: Problem) -> Equations:
    import heyoka as hy

    def level(motion: Swell) -> Any:
        waves = zip(*(values.astype(Number) for values in motion), strict=True)
        return hy.sum([a * hy.cos(w * hy.time + p) for a, w, p in waves if a]) / Number(system.gravity)

    system = problem.system
    sine = isinstance(system.restoring, Sine)
    across, weight = level(problem.horizontal), 1.0 + level(problem.vertical) if sine else 1.0
    found: Equations = []
    constants = system.natural_frequency.astype(Number), system.terms.damping_rate.astype(Number)
    for k, (n, gamma) in enumerate(zip(*constants, strict=True)):
        x, v = hy.make_vars(f"x{k}", f"v{k}")
        back = weight * hy.sin(x) + across * hy.cos(x) if sine else x + across
        found += [(x, v), (v, -2.0 * gamma * v - n * n * back)]
    return found


def _beam(system: ElasticBeam) -> Equations:
    """System (1) of Kanunnikov and Lamper, solved for the accelerations."""
    import heyoka as hy

    x, v = hy.make_vars("x", "v")
    whole = inertia = Number(system.own_mass)
    force: Any = 0.0
    swings = []
    for k, (m, length) in enumerate(zip(system.mass.astype(Number), system.length.astype(Number), strict=True)):
        angle, rate = hy.make_vars(f"phi{k}", f"rate{k}")
        sine, cosine = hy.sin(angle), hy.cos(angle)
        free = -(Number(system.gravity) / length) * sine
        if system.terms is not None:
            share = angle / Number(system.terms.angle[k])
            free = free + Number(system.terms.rate[k]) * (1.0 - share * share) * rate
        whole, inertia = whole + m, inertia + m * cosine * cosine
        force = force + m * length * (cosine * rate * rate + sine * free)
        swings.append((angle, rate, sine / length, free))
    beam = (force - Number(system.stiffness) * x - whole * Number(system.damping_rate) * v) / inertia
    return [(x, v), (v, beam), *(pair for a, r, sine, free in swings for pair in ((a, r), (r, free + sine * beam)))]


class Reference(NamedTuple):
    """True angles at some of a problem's instants."""

    rows: NDArray[np.int64]  # which instants
    angles: Floats  # (rows, judged)
    sizes: Floats  # largest size of each on the way
    source: str

    def error(self, angles: Floats) -> float:
        """Largest error of any angle at any instant, over its largest size; NaN spreads."""
        return float(np.max(np.abs(angles[self.rows] - self.angles) / self.sizes))


def reference(problem: Problem) -> Reference:
    """The best reference that the installed libraries allow."""
    rows = np.array([k for k in range(problem.count) if Fraction(float(problem.step * k)) == problem.step * k])
    times = problem.times[rows]
    more = np.union1d(times, times[0] + np.ptp(times) * np.logspace(-7.0, 0.0, _BETWEEN, endpoint=False))
    if importlib.util.find_spec("heyoka") is not None:
        # compact: a minute of compiling less
        states = taylor(problem, more, TIGHT, Number, compact_mode=True)()
        source = f"heyoka, 80 bits, {TIGHT:g}"
    else:
        name = "radau" if problem.stiff else "explicit"
        integrate = import_module(f"synth.integrators.{name}").integrate
        states = integrate(problem.system, problem.start, more, tolerance=OWN_TIGHT).states
        source = f"own {name}, {OWN_TIGHT:g}: no reference for itself"
    angles = problem.angles(states)
    return Reference(rows, angles[np.searchsorted(more, times)], np.abs(angles).max(axis=0), source)


def taylor(problem: Problem, times: Floats, tolerance: float, number: Any, **options: Any) -> Callable[[], Floats]:
    """A call that gives states (k, n) by heyoka's Taylor integration in the arithmetic of a type of number."""
    import heyoka as hy

    start, instants = problem.start.astype(number), times.astype(number)
    integrator = hy.taylor_adaptive(equations(problem), start, tol=number(tolerance), fp_type=number, **options)

    def call() -> Floats:
        integrator.time = instants[0]
        integrator.state[:] = start
        outcome, *_, states = integrator.propagate_grid(instants)
        if outcome != hy.taylor_outcome.time_limit:
            raise RefusedError(f"heyoka{'' if number is float else ', 80 bits'}: {outcome}")
        return np.asarray(states, dtype=np.float64)

    return call
