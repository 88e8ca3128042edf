"""Extreme motions, each with the truth that a propagator is held against.

Truth is a closed form or an elliptic function in 40 digits, a published value, or a different propagator at a tighter
tolerance; `source` says which. All sine cases share one type of system, and so do the linear ones: with amplitudes of
zero where a term is not wanted, few kernels are compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np

from pipeline.benchmarks import stability_truth as truth
from pipeline.benchmarks.plain_pendulums import Swell
from synth.phase import Floats
from synth.systems.driven_pendulums import DrivenPendulums
from synth.systems.elastic_beam import ElasticBeam, stiffness_of_ratio
from synth.systems.harmonic_motion import harmonics
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.resistance import Viscous
from synth.systems.restoring import Linear, Sine
from synth.systems.van_der_pol import VanDerPol

GRAVITY = 9.81
N = 6.25  # rad/s, of the pendulums unless a case says otherwise
STILL = Swell(np.zeros(1), np.ones(1), np.zeros(1))


@dataclass(frozen=True)
class Case:
    """One motion.

    Attributes
    ----------
    name : str
    kind : str
        Which propagators are made for it: see `stability_expected.SUITED`.
    system : NamedTuple
    start : (n,) array
    step : Fraction
        s, between readings.
    count : int
        Readings, the start among them.
    true : callable
        What to compare the judged components, or the figure, with: (count, judged), NaN where nothing is compared.
    source : str
        Of the truth.
    figure : callable or None
        Makes of all states (count, n) a figure (1, 1), which is compared instead.
    judged : tuple of int
    horizontal, vertical : Swell
    """

    name: str
    kind: str
    system: Any
    start: Floats
    step: Fraction
    count: int
    true: Callable[[], Floats]
    source: str
    judged: tuple[int, ...] = (0,)
    figure: Callable[[Floats], Floats] | None = None
    horizontal: Swell = STILL
    vertical: Swell = STILL
    table: tuple[Floats, Floats] | None = None
    """Times and accelerations of a tabulated motion."""
    apart: float = 0.0
    """How far the truth itself may be from this motion, relative: a limit that is only approached."""

    @property
    def times(self) -> Floats:
        """Readings, s, as doubles."""
        return np.array([float(self.step * k) for k in range(self.count)])


def pendulums(
    name: str,
    start: tuple[float, ...],
    step: Fraction,
    count: int,
    true: Callable[[], Floats],
    source: str,
    *,
    linear: bool = False,
    frequency: tuple[float, ...] = (N,),
    damping: float = 0.0,
    horizontal: Swell = STILL,
    vertical: Swell = STILL,
) -> Case:
    """Pendulums on a support that moves as told."""
    n = np.array(frequency)
    system = DrivenPendulums(
        n,
        GRAVITY,
        Linear() if linear else Sine(),
        harmonics(*horizontal),
        None if linear else harmonics(*vertical),
        Viscous(np.full(n.size, damping)),
    )
    judged = tuple(range(0, 2 * n.size, 2))
    kind = ("overdamped" if damping > N else "linear") if linear else "sine"
    return Case(name, kind, system, np.array(start), step, count, true, source, judged, None, horizontal, vertical)


def cases() -> tuple[Case, ...]:
    """All of them."""
    return (*_linear(), *_sine(), *_heave(), *_stiff(), *_beams(), *_tables())


def _one(amplitude: float, rate: float, phase: float = 0.3) -> Swell:
    return Swell(np.array([amplitude]), np.array([rate]), np.array([phase]))


def _linear() -> tuple[Case, ...]:
    tenth = Fraction(1, 10)

    def made(
        name: str,
        start: tuple[float, ...] = (0.01, 0.02),
        step: Fraction = tenth,
        count: int = 6001,
        frequency: tuple[float, ...] = (N,),
        damping: float = 0.0,
        swell: Swell = STILL,
    ) -> Case:
        return pendulums(
            name,
            start,
            step,
            count,
            lambda: truth.linear(frequency, damping, start, swell, GRAVITY, step, count),
            "closed form, 60 digits",
            linear=True,
            frequency=frequency,
            damping=damping,
            horizontal=swell,
        )

    swell = _one(0.5, 0.9)
    return (
        made("exact resonance", swell=_one(1e-3, N)),
        made("resonance detuned by 1e-12", swell=_one(1e-3, N * (1.0 + 1e-12))),
        made("exact resonance, damped", damping=1e-3, swell=_one(1e-3, N)),
        made("equal frequencies", (0.01, 0.0, 0.01, 0.0), frequency=(N, N), swell=swell),
        made("zero amplitude, still", (0.0, 0.0)),
        made("zero amplitude, swell", (0.0, 0.0), swell=swell),
        made("damping 1e-3 below critical", damping=N * (1.0 - 1e-3), count=101, swell=swell),
        made("damping 1e-12 below critical", damping=N * (1.0 - 1e-12), count=101, swell=swell),
        made("overdamped, 10 /s", damping=10.0, count=101, swell=swell),
        made("overdamped, 1e4 /s", damping=1e4, count=101, swell=swell),
        made("1 ms long", step=Fraction(1, 10_000), count=11, swell=swell),
        made("1e7 s long, every 10 s", step=Fraction(10), count=1_000_001, damping=1e-7, swell=swell),
        made("read every 7.3 s", step=Fraction(73, 10), count=301, swell=swell),
        made("read at 1 MHz", step=Fraction(1, 1_000_000), count=20_001, swell=swell),
        made("forced at 1 kHz", step=tenth, count=101, swell=_one(500.0, 2000.0 * np.pi)),
        made("forced at 1e-6 Hz", swell=_one(0.1, 2e-6 * np.pi)),
    )


def _sine() -> tuple[Case, ...]:
    step = Fraction(1, 20)

    def swing(name: str, angle: float, seconds: float, every: Fraction = step) -> Case:
        count = int(Fraction(seconds) / every) + 1
        return pendulums(
            name,
            (angle, 0.0),
            every,
            count,
            lambda: truth.swing(N, angle, every, count),
            "elliptic function, 40 digits",
        )

    rotation = 2.5 * N
    fast = _one(3.0 * GRAVITY, 2.0, 0.0)
    return (
        swing("1e-6 rad", 1e-6, 100.0),
        swing("1 rad", 1.0, 100.0),
        swing("3.1 rad", 3.1, 30.0),
        swing("3.14159 rad, to the other side", 3.14159, 4.5),
        swing("1 rad, 1 ms long", 1.0, 0.001, Fraction(1, 10_000)),
        swing("1 rad, read every 7.3 s", 1.0, 730.0, Fraction(73, 10)),
        pendulums(
            "over the top",
            (0.0, rotation),
            step,
            401,
            lambda: truth.rotation(N, rotation, step, 401),
            "elliptic function, 40 digits",
        ),
        pendulums(
            "on the separatrix, 2 s",
            (0.0, 2.0 * N),
            step,
            41,
            lambda: truth.separatrix(N, step, 41),
            "closed form",
        ),
        pendulums(
            "on the separatrix, 20 s",
            (0.0, 2.0 * N),
            step,
            401,
            lambda: truth.separatrix(N, step, 401),
            "closed form",
        ),
        pendulums("zero amplitude, sine", (0.0, 0.0), step, 201, lambda: np.zeros((201, 1)), "rest"),
        pendulums(
            "free fall, z'' = -g",
            (0.3, 0.1),
            step,
            101,
            partial(truth.straight, 0.3, 0.1, step, 101),
            "straight line",
            vertical=_one(-GRAVITY, 0.0, 0.0),
        ),
        pendulums(
            "beyond free fall, z'' = -2 g",
            (0.3, 0.0),
            step,
            101,
            partial(truth.inverted, N, 0.3, step, 101),
            "elliptic function, 40 digits",
            vertical=_one(-2.0 * GRAVITY, 0.0, 0.0),
        ),
        _violent("several g", (0.1, 0.0), step, 101, fast, _one(2.0 * GRAVITY, 3.0, 0.5)),
        _violent("resonance of a real pendulum", (0.01, 0.0), step, 2001, _one(1e-2 * GRAVITY, N, 0.0), STILL),
    )


def _violent(
    name: str, start: tuple[float, ...], step: Fraction, count: int, horizontal: Swell, vertical: Swell
) -> Case:
    """Without a closed form: truth by another propagator."""
    return pendulums(
        name, start, step, count, lambda: np.zeros(0), truth.ANOTHER, horizontal=horizontal, vertical=vertical
    )


def _heave() -> tuple[Case, ...]:
    """Mathieu's equation `y'' + (a - 2 q cos 2t) y = 0`: the trace of the monodromy matrix over pi."""
    out = []
    for words, a, q, trace in truth.MATHIEU:
        system = DrivenPendulums(
            np.full(2, np.sqrt(a)), 1.0, Linear(), None, harmonics([-2.0 * q / a], [2.0], [0.0]), None
        )
        out.append(
            Case(
                f"parametric, {words}: a = {a:g}, q = {q:g}",
                "heave",
                system,
                np.array([1.0, 0.0, 0.0, 1.0]),
                Fraction(np.pi),
                2,
                partial(np.full, (1, 1), trace),
                "Taylor series, 30 digits",
                figure=lambda states: np.array([[states[-1, 0] + states[-1, 3]]]),
            )
        )
    return tuple(out)


def _stiff() -> tuple[Case, ...]:
    """The escapement as van der Pol's oscillator, delta = mu."""
    out = []
    for mu, end, value in truth.VAN_DER_POL:
        out.append(
            Case(
                f"escapement, delta = {mu:g}",
                "oscillator",
                VanDerPol(mu),
                np.array([2.0, 0.0]),
                Fraction(end),
                2,
                partial(np.array, [[2.0], [value]]),
                "80-bit Taylor integration",
            )
        )
    return tuple(out)


def _beams() -> tuple[Case, ...]:
    light = ElasticBeam(50.0, np.array([0.25]), np.array([1.0]), 0.0, 0.0, GRAVITY)
    out = [
        Case(
            f"beam {ratio:.0e} times stiffer".replace("+0", ""),
            "beam",
            light._replace(
                stiffness=stiffness_of_ratio(ratio, light), damping_rate=0.3 * ratio * float(np.sqrt(GRAVITY))
            ),
            np.array([0.0, 0.0, 1.0, 0.0]),
            Fraction(10),
            2,
            lambda: truth.swing(float(np.sqrt(GRAVITY)), 1.0, Fraction(10), 2),
            "rigid limit, approached as ratio^-2",
            judged=(2,),
            apart=0.2 / ratio**2,
        )
        for ratio in (1e2, 1e3, 1e4, 1e5, 1e6)
    ]
    heavy = ElasticBeam(1e-3, np.array([1.0, 1.0]), np.array([1.0, 0.9]), 150.0, 0.0, GRAVITY)
    out.append(
        Case(
            "light beam, M/m = 1e-3",
            "beam",
            heavy,
            np.array([0.05, 0.0, 0.3, 0.0, -0.2, 0.0]),
            Fraction(1, 20),
            101,
            lambda: np.zeros(0),
            truth.ANOTHER,
            judged=(2, 4),
        )
    )
    # 1 - 2 m0 y^2: 2e-2 at the start of the first, which swings towards rest; nothing but an error in the second
    for words, y in (("near-singular mass matrix of (2)", 0.99), ("singular mass matrix of (2)", 1.0)):
        coupling = 1e-2
        out.append(
            Case(
                words,
                "reduced",
                ReducedBeam(0.02, 0.02, coupling, np.array([-0.01])),
                np.array([0.0, 0.0, y / np.sqrt(2.0 * coupling), 0.0]),
                Fraction(1, 20),
                41,
                lambda: np.zeros(0),
                truth.ANOTHER,
                judged=(2,),
            )
        )
    return tuple(out)


def _tables() -> tuple[Case, ...]:
    """Motions as they come from a ship's recorder, which nobody can integrate."""
    seconds = np.arange(301) / 5.0
    swell = 0.3 * np.sin(0.9 * seconds)
    lost = np.where(np.abs(seconds - 20.0) < 0.3, np.nan, swell)
    jump = swell + 1.0 * (seconds > 20.0)
    model = pendulums("-", (0.01, 0.0), Fraction(1, 10), 301, lambda: np.zeros((301, 1)), "none", linear=True)
    return tuple(
        replace(model, name=name, kind="table", table=(seconds, values))
        for name, values in (("tabulated motion with a jump", jump), ("tabulated motion with NaN", lost))
    )
