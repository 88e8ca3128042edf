"""How errors grow over many oscillations: the exponent p of `error ~ time^p`.

Rounding that is unbiased makes the energy wander as sqrt(t) (Brouwer's law). The phase of a pendulum whose period
depends on its arc then errs as t^1.5; that of a clock, whose arc is held, as sqrt(t); a closed form does not err more.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.benchmarks.linear_hour import RATE, closed_form, task
from pipeline.benchmarks.linear_hour import reference as in_forty_digits
from pipeline.benchmarks.problems import Problem, beam
from pipeline.benchmarks.progress import progress
from pipeline.benchmarks.references import in_eighty_bits
from synth.motion.harmonic_sum import HarmonicSum
from synth.phase import Floats
from synth.systems.driven_pendulums import plain

OSCILLATIONS, QUICK_OSCILLATIONS = 100_000, 1_000
TOLERANCE = 1e-13
FREQUENCY = 6.25  # rad/s
AMPLITUDE = 0.3  # rad
_PLACES = 24  # times at which errors are looked at, evenly in the logarithm
_LOOKS = 12  # instants at each, over about a swing
_FROM = 30.0  # swings from which on the exponent is fitted


@dataclass(frozen=True)
class Growth:
    """Errors of one method along the way.

    Attributes
    ----------
    case, method : str
    swings : (places,) array
        Oscillations behind.
    errors : (places,) array
        Largest up to there, relative to the largest angle.
    expected : float
        The exponent that unbiased rounding gives; NaN where none is known.
    note : str
    """

    case: str
    method: str
    swings: Floats
    errors: Floats
    expected: float
    note: str = ""

    @property
    def exponent(self) -> float:
        """Slope of the logarithms from 30 swings on; NaN where there is no error."""
        kept = (self.swings >= _FROM) & (self.errors > 0.0)
        if np.count_nonzero(kept) < 3:
            return float("nan")
        return float(np.polyfit(np.log(self.swings[kept]), np.log(self.errors[kept]), 1)[0])

    def row(self) -> dict[str, Any]:
        """As the suite yields it."""
        end = float(self.swings[-1]) if self.swings.size else float("nan")
        return {
            "growth": self.case,
            "method": self.method,
            "oscillations": end,
            "error_at_end": float(self.errors[-1]) if self.errors.size else float("nan"),
            "exponent": self.exponent,
            "unbiased_rounding": self.expected,
            "note": self.note,
        }


def grown(*, quick: bool) -> Iterator[Growth]:
    """Every case with every propagator that is meant for so long a way."""
    count = QUICK_OSCILLATIONS if quick else OSCILLATIONS
    cases: tuple[Callable[[int], Iterator[Growth]], ...] = (_linear, _free_swing, _beam)
    for case in progress(cases, "growth", len(cases)):
        yield from case(count)


def looks(count: int, swing: float) -> Floats:
    """Instants to look at, s: bunches over a swing, evenly in the logarithm."""
    places = np.geomspace(1.0, float(count - 1), _PLACES)
    return np.unique(((places[:, None] + np.arange(_LOOKS) / _LOOKS) * swing).ravel())


def _collected(
    case: str, method: str, times: Floats, errors: Floats, swing: float, expected: float, note: str = ""
) -> Growth:
    return Growth(case, method, times / swing, np.maximum.accumulate(errors), expected, note)


def _linear(count: int) -> Iterator[Growth]:
    """The closed form, two pendulums under 33 harmonics."""
    if importlib.util.find_spec("mpmath") is None:
        return
    given = task(count + 2)
    rows = np.unique(np.rint(looks(count, 1.0) * RATE).astype(np.int64))
    true = in_forty_digits(given, rows)
    errors = np.abs(closed_form(given)[:, rows] - true).max(axis=0) / np.abs(true).max()
    yield _collected("linear, 33 harmonics", "closed form", rows / RATE, errors, 1.01, 0.0)


def _free_swing(count: int) -> Iterator[Growth]:
    """One pendulum of 0.3 rad, against elliptic functions in 40 digits."""
    if importlib.util.find_spec("mpmath") is None:
        return
    swing = 2.0 * np.pi / FREQUENCY
    times = np.concatenate([[0.0], looks(count, swing)])
    true = elliptic(FREQUENCY, AMPLITUDE, times)

    def picard() -> Floats:
        from fractions import Fraction

        from synth.propagators.picard import PicardPlan
        from synth.propagators.uneven import UnevenTimes

        still = HarmonicSum(np.zeros(0), np.zeros(0, dtype=np.complex128))
        plan = PicardPlan(
            np.array([FREQUENCY]),
            np.zeros(1),
            np.array([[AMPLITUDE, 0.0]]),
            still,
            still,
            9.81,
            UnevenTimes(times, Fraction(1)),
        )
        return np.asarray(plan.elongation()[0][0])

    calls: Mapping[str, Callable[[], Floats]] = {
        "Picard collocation": picard,
        "explicit": lambda: _integrated("explicit", plain(FREQUENCY), np.array([AMPLITUDE, 0.0]), times)[:, 0],
        "Radau": lambda: _integrated("radau", plain(FREQUENCY), np.array([AMPLITUDE, 0.0]), times)[:, 0],
    }
    case = f"one pendulum, {AMPLITUDE:g} rad"
    for method, call in calls.items():
        try:
            errors = np.abs(call() - true) / AMPLITUDE
        except RefusedError as refusal:
            yield Growth(case, method, np.zeros(0), np.zeros(0), 1.5, f"refused: {refusal}")
            continue
        yield _collected(case, method, times, errors, swing, 1.5)


def elliptic(frequency: float, amplitude: float, times: Floats) -> Floats:
    """Angle of a pendulum released at rest at `amplitude`: `sin(theta/2) = k cd(n t, k)`, in 40 digits, rad."""
    mpmath: Any = import_module("mpmath")
    with mpmath.mp.workdps(40):
        modulus = mpmath.sin(mpmath.mpf(float(amplitude)) / 2)
        n = mpmath.mpf(float(frequency))
        values = [
            2 * mpmath.asin(modulus * mpmath.ellipfun("cd", n * mpmath.mpf(float(t)), m=modulus**2)) for t in times
        ]
        return np.array([float(value) for value in values])


def _beam(count: int) -> Iterator[Growth]:
    """Two clocks on a beam, against 80-bit Taylor integration."""
    if importlib.util.find_spec("heyoka") is None:
        return
    problem = beam(2)
    times = np.concatenate([[0.0], looks(count, 1.0)])
    true = in_eighty_bits(problem, times)[:, list(problem.judged)]
    for method, name in (("beam collocation", "collocation"), ("explicit", "explicit")):
        if importlib.util.find_spec(f"synth.integrators.{name}") is None:
            continue
        yield _clocks(problem, method, name, times, true)


def _clocks(problem: Problem, method: str, name: str, times: Floats, true: Floats) -> Growth:
    case = "two clocks on a beam"
    try:
        found = _integrated(name, problem.system, problem.start, times)[:, list(problem.judged)]
    except RefusedError as refusal:
        return Growth(case, method, np.zeros(0), np.zeros(0), 0.5, f"refused: {refusal}")
    errors = (np.abs(found - true) / np.abs(true).max(axis=0)).max(axis=1)
    return _collected(case, method, times, errors, 1.0, 0.5)


def _integrated(name: str, system: Any, start: Floats, times: Floats) -> Floats:
    integrate = import_module(f"synth.integrators.{name}").integrate
    return np.asarray(integrate(system, start, times, tolerance=TOLERANCE).states)
