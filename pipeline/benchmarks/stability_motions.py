"""Extreme motions, each with its truth and with what the propagators must do with it, written down beforehand.

Truth is a closed form or an elliptic function in 40 digits, a published value, or a different propagator at a tighter
tolerance; `source` says which. A propagator that is not made for a kind of motion declines it; the others must meet
their bound, unless the case names the reason for which they may decline.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial

import numpy as np

from pipeline.benchmarks import truth
from pipeline.benchmarks.own import CLOSED, COLLOCATION, EXPLICIT, PICARD, RADAU, SPLITTING
from pipeline.benchmarks.problems import GRAVITY, STILL, Problem, Swell, pendulums
from synth.phase import Floats
from synth.systems.driven_pendulums import DrivenPendulums
from synth.systems.elastic_beam import ElasticBeam, stiffness_of_ratio
from synth.systems.harmonic_motion import harmonics
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.restoring import Linear
from synth.systems.van_der_pol import VanDerPol

SIMULATE = "simulate"
"""The whole simulator, from a scene, with the propagator that it chooses."""
PROPAGATORS = (CLOSED, PICARD, COLLOCATION, RADAU, EXPLICIT, SPLITTING, SIMULATE)
SUITED: Mapping[str, tuple[str, ...]] = {
    "linear": (CLOSED, RADAU, EXPLICIT, SIMULATE),
    "overdamped": (RADAU, EXPLICIT, SIMULATE),
    "sine": (PICARD, RADAU, EXPLICIT, SPLITTING, SIMULATE),
    "heave": (RADAU, EXPLICIT),
    "oscillator": (RADAU, EXPLICIT),
    "beam": (COLLOCATION, RADAU, EXPLICIT, SIMULATE),
    "reduced": (RADAU, EXPLICIT),
    "table": (SIMULATE,),
}
"""Kind of motion -> propagators made for it."""

N = 6.25  # rad/s, of the pendulums
BOUND = 1e-8
"""Largest error, relative to the largest angle, of a cell that must be solved."""
DIGITS, ANOTHER = "elliptic function, 40 digits", "another propagator, tighter"
_VIOLENT = "the motion is far from that of the linear pendulum about which it is expanded"
_STIFF = "stiff: the motion is far slower than what an explicit step can bear"
_LONG = "a million swings are the closed form's business"
_TOP = "on the separatrix rounding alone decides where the pendulum goes"
_EXPANDED = {PICARD: _VIOLENT, SPLITTING: _VIOLENT}


@dataclass(frozen=True)
class Case:
    """One motion.

    Attributes
    ----------
    problem : Problem
    true : callable or None
        Instants, exact, give the judged components, or the figure, (instants, judged); None: another propagator does.
    source : str
        Of the truth.
    may_refuse : mapping
        Propagators made for the kind that may decline all the same, and why; a value must be honest.
    must_refuse : str
        Why any value would be wrong, if it would.
    not_asked : tuple of str
        Propagators that would take minutes or hours.
    bounds : mapping
        Bounds of single propagators, tighter than `BOUND`.
    figure : callable or None
        Makes of all states (count, n) a figure (1, 1), which is compared instead.
    table : (2,) tuple of arrays, optional
        Times and accelerations of a tabulated motion.
    apart : float
        How far the truth itself may be from this motion, relative: a limit that is only approached.
    """

    problem: Problem
    true: Callable[[Sequence[Fraction]], Floats] | None
    source: str
    may_refuse: Mapping[str, str] = field(default_factory=dict)
    must_refuse: str = ""
    not_asked: tuple[str, ...] = ()
    bounds: Mapping[str, float] = field(default_factory=dict)
    figure: Callable[[Floats], Floats] | None = None
    table: tuple[Floats, Floats] | None = None
    apart: float = 0.0

    @property
    def name(self) -> str:
        """Of the motion."""
        return self.problem.name

    def may_decline(self, propagator: str) -> bool:
        """Whether the cell was named beforehand as one that may decline."""
        return bool(self.must_refuse) or propagator not in SUITED[self.problem.kind] or propagator in self.may_refuse


def cases() -> tuple[Case, ...]:
    """All of them."""
    return (*_linear(), *_sine(), *_heave(), *_stiff(), *_beams(), *_tables())


def _one(amplitude: float, rate: float, phase: float = 0.3) -> Swell:
    return Swell(np.array([amplitude]), np.array([rate]), np.array([phase]))


def _linear() -> tuple[Case, ...]:
    def made(
        name: str,
        start: tuple[float, ...] = (0.01, 0.02),
        step: Fraction = Fraction(1, 10),
        count: int = 6001,
        frequency: tuple[float, ...] = (N,),
        damping: float = 0.0,
        swell: Swell = STILL,
    ) -> Case:
        problem = pendulums(
            name, start, step, count, linear=True, frequency=frequency, damping=damping, horizontal=swell
        )
        return Case(problem, partial(truth.linear, problem), "closed form, 100 digits")

    swell = _one(0.5, 0.9)
    long = made("1e7 s long, every 10 s", step=Fraction(10), count=1_000_001, damping=1e-7, swell=swell)
    return (
        replace(made("exact resonance", swell=_one(1e-3, N)), bounds={CLOSED: 1e-13}),
        replace(made("resonance detuned by 1e-12", swell=_one(1e-3, N * (1.0 + 1e-12))), bounds={CLOSED: 1e-13}),
        made("exact resonance, damped", damping=1e-3, swell=_one(1e-3, N)),
        replace(
            made("equal frequencies", (0.01, 0.0, 0.01, 0.0), frequency=(N, N), swell=swell), bounds={CLOSED: 1e-14}
        ),
        made("zero amplitude, still", (0.0, 0.0)),
        made("zero amplitude, swell", (0.0, 0.0), swell=swell),
        made("damping 1e-12 below critical", damping=N * (1.0 - 1e-12), count=101, swell=swell),
        made("overdamped, 10 /s", damping=10.0, count=101, swell=swell),
        replace(made("overdamped, 1e4 /s", damping=1e4, count=101, swell=swell), may_refuse={EXPLICIT: _STIFF}),
        made("1 ms long", step=Fraction(1, 10_000), count=11, swell=swell),
        replace(
            long,
            may_refuse={EXPLICIT: _LONG, RADAU: _LONG},
            not_asked=(EXPLICIT, RADAU),
            bounds={CLOSED: 1e-13},
        ),
        made("read every 7.3 s", step=Fraction(73, 10), count=301, swell=swell),
        replace(
            made("read at 1 MHz", step=Fraction(1, 1_000_000), count=20_001, swell=swell),
            may_refuse={SIMULATE: "records are read 1e5 times a second at most"},
        ),
        made("forced at 1 kHz", count=101, swell=_one(500.0, 2000.0 * np.pi)),
        made("forced at 1e-6 Hz", swell=_one(0.1, 2e-6 * np.pi)),
    )


def _sine() -> tuple[Case, ...]:
    def made(
        name: str,
        start: tuple[float, float],
        count: int,
        step: Fraction = Fraction(1, 20),
        horizontal: Swell = STILL,
        vertical: Swell = STILL,
    ) -> Problem:
        return pendulums(
            name, start, step, count, linear=False, frequency=(N,), horizontal=horizontal, vertical=vertical
        )

    def swing(name: str, angle: float, count: int, step: Fraction = Fraction(1, 20)) -> Case:
        return Case(made(name, (angle, 0.0), count, step), partial(truth.swing, N, angle), DIGITS)

    up = partial(truth.separatrix, N)
    fall, turned = _one(-GRAVITY, 0.0, 0.0), _one(-2.0 * GRAVITY, 0.0, 0.0)
    fast, lifted = _one(3.0 * GRAVITY, 2.0, 0.0), _one(2.0 * GRAVITY, 3.0, 0.5)
    near = _one(1e-2 * GRAVITY, N, 0.0)
    return (
        swing("1e-6 rad", 1e-6, 2001),
        replace(swing("1 rad", 1.0, 2001), bounds={PICARD: 1e-13}),
        replace(swing("3.1 rad", 3.1, 601), may_refuse=_EXPANDED),
        replace(swing("3.14159 rad, to the other side", 3.14159, 91), may_refuse=_EXPANDED),
        swing("1 rad, 1 ms long", 1.0, 11, Fraction(1, 10_000)),
        swing("1 rad, read every 7.3 s", 1.0, 101, Fraction(73, 10)),
        Case(made("over the top", (0.0, 2.5 * N), 401), None, ANOTHER, _EXPANDED),
        Case(made("on the separatrix, 2 s", (0.0, 2.0 * N), 41), up, "closed form", _EXPANDED),
        Case(
            made("on the separatrix, 20 s", (0.0, 2.0 * N), 401), up, "closed form",
            dict.fromkeys((PICARD, RADAU, EXPLICIT, SPLITTING, SIMULATE), _TOP),
        ),
        Case(made("zero amplitude, sine", (0.0, 0.0), 201), lambda instants: np.zeros((len(instants), 1)), "rest"),
        Case(
            made("free fall, z'' = -g", (0.3, 0.1), 101, vertical=fall),
            lambda instants: np.array([[0.3 + 0.1 * float(each)] for each in instants]),
            "straight line",
            _EXPANDED,
        ),
        Case(
            made("beyond free fall, z'' = -2 g", (0.3, 0.0), 101, vertical=turned),
            lambda instants: np.asarray(np.pi - truth.swing(N, float(np.pi) - 0.3, instants)),
            DIGITS,
            _EXPANDED,
        ),
        Case(made("several g", (0.1, 0.0), 101, horizontal=fast, vertical=lifted), None, ANOTHER, _EXPANDED),
        Case(made("resonance of a real pendulum", (0.01, 0.0), 2001, horizontal=near), None, ANOTHER),
    )  # fmt: skip


def _heave() -> tuple[Case, ...]:
    """Mathieu's equation `y'' + (a - 2 q cos 2t) y = 0`: the trace of the monodromy matrix over pi."""
    out = []
    for words, a, q, trace in truth.MATHIEU:
        heave = harmonics([-2.0 * q / a], [2.0], [0.0])
        system = DrivenPendulums(np.full(2, np.sqrt(a)), 1.0, Linear(), None, heave, None)
        name = f"parametric, {words}: a = {a:g}, q = {q:g}"
        problem = Problem(name, "heave", system, np.array([1.0, 0.0, 0.0, 1.0]), Fraction(np.pi), 2)
        out.append(
            Case(
                problem,
                lambda instants, trace=trace: np.array([[trace]]),  # type: ignore[misc]  # bound now
                "Taylor series, 30 digits",
                figure=lambda states: np.array([[states[-1, 0] + states[-1, 3]]]),
            )
        )
    return tuple(out)


def _stiff() -> tuple[Case, ...]:
    """The escapement as van der Pol's oscillator, delta = mu."""
    return tuple(
        Case(
            Problem(f"escapement, delta = {mu:g}", "oscillator", VanDerPol(mu), np.array([2.0, 0.0]), Fraction(end), 2),
            lambda instants, value=value: np.array([[2.0], [value]]),  # type: ignore[misc]  # bound now
            "80-bit Taylor integration",
            {EXPLICIT: _STIFF} if mu > 1.0 else {},
        )
        for mu, end, value in truth.VAN_DER_POL
    )


def _beams() -> tuple[Case, ...]:
    light = ElasticBeam(50.0, np.array([0.25]), np.array([1.0]), 0.0, 0.0, GRAVITY)
    frequency = float(np.sqrt(GRAVITY))
    out = []
    for power in (2, 4, 6):
        ratio = 10.0**power
        system = light._replace(stiffness=stiffness_of_ratio(ratio, light), damping_rate=0.3 * ratio * frequency)
        name = f"beam 1e{power} times stiffer"
        problem = Problem(name, "beam", system, np.array([0.0, 0.0, 1.0, 0.0]), Fraction(10), 2, (2,))
        out.append(
            Case(
                problem,
                partial(truth.swing, frequency, 1.0),
                "rigid limit, approached as ratio^-2",
                {EXPLICIT: _STIFF, COLLOCATION: _STIFF},
                apart=0.2 / ratio**2,
            )
        )
    heavy = ElasticBeam(1e-3, np.array([1.0, 1.0]), np.array([1.0, 0.9]), 150.0, 0.0, GRAVITY)
    start = np.array([0.05, 0.0, 0.3, 0.0, -0.2, 0.0])
    problem = Problem("light beam, M/m = 1e-3", "beam", heavy, start, Fraction(1, 20), 101, (2, 4))
    out.append(Case(problem, None, ANOTHER, {COLLOCATION: "the coupling is no small remainder"}))
    # 1 - 2 m0 y^2: 2e-2 at the start of the first, which swings towards rest; nothing but an error in the second
    coupling = 1e-2
    system = ReducedBeam(0.02, 0.02, coupling, np.array([-0.01]))
    for name, y, why in (
        ("near-singular mass matrix of (2)", 0.99, ""),
        ("singular mass matrix of (2)", 1.0, "there is no acceleration"),
    ):
        start = np.array([0.0, 0.0, y / np.sqrt(2.0 * coupling), 0.0])
        out.append(
            Case(Problem(name, "reduced", system, start, Fraction(1, 20), 41, (2,)), None, ANOTHER, must_refuse=why)
        )
    return tuple(out)


def _tables() -> tuple[Case, ...]:
    """Motions as they come from a ship's recorder, which nobody can integrate."""
    seconds = np.arange(301) / 5.0
    swell = 0.3 * np.sin(0.9 * seconds)
    lost = np.where(np.abs(seconds - 20.0) < 0.3, np.nan, swell)
    jump = swell + 1.0 * (seconds > 20.0)
    model = pendulums("-", (0.01, 0.0), Fraction(1, 10), 301, linear=True, frequency=(N,))
    return tuple(
        Case(replace(model, name=name, kind="table"), None, "none", must_refuse=why, table=(seconds, values))
        for name, values, why in (
            ("tabulated motion with a jump", jump, "between two readings the motion is anything"),
            ("tabulated motion with NaN", lost, "the motion is not known"),
        )
    )
