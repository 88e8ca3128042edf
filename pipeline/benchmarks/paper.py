"""Suite `paper`: the figures and claims of Panteleev (1958), each beside what is computed here.

The paper argues that gravity at sea cannot be had from one pendulum, because a forcing close to its own frequency
disturbs its period by 2e-3 s, and can be had from the difference of two; and that what it neglects is small. Each
figure of that is the error of gravity that leaving the term out would cause, positive where gravity would come out too
large: integrated and regressed with the weights of the phase, as the correction itself is. Between (26) and (27) the
paper drops, averaged over a swing,

    (n1-n2) (Theta1/2 n1 a) [(Phi1' - n1) cos(Phi1-phi) + (Theta1'/Theta1) sin(Phi1-phi)]

and before (24) `(n1-n2) xi/g`, whose part that turns with the pendulum is `(Z1' - i n1 Z1)/(i n1)`: twice as much. It
drops psi1-psi2 after (18), damping and the finite arc throughout.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from data_schemas.scene import Scene
from pipeline.arrays import Complexes, Floats
from pipeline.benchmarks.scenes import PERIOD, REFERENCE, SWELL, errors, prepared, swell, two_pendulums
from pipeline.benchmarks.tables import Row, rms
from pipeline.conditions import MGAL
from pipeline.correction import integrated, model_speed
from pipeline.harmonics.envelope import Envelope, fill
from pipeline.harmonics.narrowband import regression
from pipeline.methods.phases import MARK_SECONDS, phases
from pipeline.phase_speed import disturbed_speed, leaking, near_resonant_amplitude, phase_speed
from pipeline.prepared import Prepared
from synth import simulate

SLOW_BAND = 0.8  # of n2: faster motion belongs to the free harmonic
BEAT = 120.0  # s, "the disturbed amplitude changes with a period of two minutes"
_FREQUENCY = 2.0 * np.pi / PERIOD
_DETUNING = np.pi / BEAT
_FILM = 100.0  # mm, largest slow elongation on the photograph
_DIFFERENCE = 1e-5  # s, T1 - T2


def neglected_terms(ready: Prepared) -> dict[str, float]:
    """Size of every term that the paper neglects, mGal; `RefusedError` where the difference has no usable phase:
    `first_speed` (n1-n2)(Phi1'-n1); `first_growth` (n1-n2) Theta1'/Theta1; `forcing` (n1-n2) xi/g; `slow_difference`
    psi1-psi2; `damping_difference` gamma1-gamma2 (0 if not stated); `finite_arc` -n Theta^2/16 of both pendulums."""
    found = phases(ready)
    envelope, seen = found.envelope, ready.observation
    frequency = ready.fine.frequency
    first_frequency = seen.frequency_ratio * frequency
    own = 1j * (envelope.carrier - first_frequency)
    relative = (envelope.first_speed / envelope.first + own) / first_frequency  # Theta1'/Theta1 + i (Phi1'-n1), over n1
    share = envelope.share
    half = 0.5 * (first_frequency - frequency)
    with_arc, without = (model_speed(ready, frequency, arc=arc) for arc in (True, False))
    speeds = {
        "first_speed": half * relative.imag * share.real,
        "first_growth": half * relative.real * share.imag,
        "forcing": 2.0 * half * (relative.imag * share.real + relative.real * share.imag),
        "damping_difference": -seen.damping_difference * share.imag,
        "finite_arc": with_arc - without,
    }
    scale = 2.0 * seen.reference_gravity * frequency / ready.nominal**2 / MGAL  # mGal per rad s-1
    time, weight, here = envelope.time, found.weight, found.weight > 0.0
    turned = {name: integrated(speed, envelope.hop) for name, speed in speeds.items()}
    worth = {name: scale * regression(time[here], turn[here], weight[here]) for name, turn in turned.items()}
    worth["slow_difference"] = scale * _slow_slope(ready, envelope, first_frequency, frequency)
    return worth


def _slow_slope(ready: Prepared, envelope: Envelope, first_frequency: float, frequency: float) -> float:
    """Slope that psi1-psi2, read as part of the harmonic, would add to the phase of `theta - i theta'/n`, rad s-1."""
    seen = ready.observation
    count = seen.time.size
    time = np.linspace(0.0, float(seen.time[-1]), count)
    turning = np.exp(1j * envelope.carrier * time)
    first, difference = (
        np.interp(time, envelope.time, fill(each)) * turning for each in (envelope.first, envelope.difference)
    )
    known = np.isfinite(seen.theta)
    slow = np.interp(time, seen.time[known], seen.theta[known]) - first.real
    rate = 2.0 * np.pi * np.fft.rfftfreq(count, float(time[1]))
    inside = rate < SLOW_BAND * frequency
    # the exact identity for one harmonic: d'' + n2^2 d = (1 - r) psi1''
    share, square = 1.0 - (frequency / first_frequency) ** 2, np.where(inside, rate, 0.0) ** 2
    spectrum = np.fft.rfft(slow) * (-share * square / (frequency**2 - square))
    value, speed = np.fft.irfft(spectrum, count), np.fft.irfft(1j * rate * spectrum, count)
    shift = ((value - 1j * speed / frequency) / difference).imag
    within = (time >= envelope.time[0]) & (time <= envelope.time[-1])
    return regression(time[within], shift[within], np.abs(difference[within]) ** 2)


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield one row a claim: the paper's value, the computed one, whether they agree. Quick and full are the same."""
    yield from _one_pendulum()
    yield from _leak()
    yield from _film()
    yield from _neglected()


def _row(claim: str, paper: str, computed: float, unit: str, agree: bool) -> Row:
    return {"claim": claim, "paper": paper, "computed": float(computed), "unit": unit, "pass": bool(agree)}


def _resonant_scene() -> Scene:
    """Two minutes' beat of 10 mrad on pendulums of 1e-5 s period difference."""
    alpha = 0.01 / abs(near_resonant_amplitude(_FREQUENCY, _DETUNING, 1.0))
    near = {"kind": "near-resonant", "amplitude": alpha * REFERENCE, "beat_period": BEAT, "phase": 0.3}
    return two_pendulums("two-minute-beat", 1e-5, motion=[near], gravity=REFERENCE, amplitudes=(0.012, 0.006))


def _one_pendulum() -> Iterator[Row]:
    yield _row("nu for a beat of two minutes", "about 0.03", _DETUNING, "rad/s", 0.025 < _DETUNING < 0.035)
    shift = 0.5 * PERIOD * _DETUNING / _FREQUENCY / 1e-7
    yield _row("half-period disturbance nu T^2/(4 pi)", "more than 20 000", shift, "1e-7 s", 21_200 < shift < 21_300)
    time = np.arange(0.0, 10.0 * BEAT, 0.1)
    beta = near_resonant_amplitude(_FREQUENCY, _DETUNING, 0.01 / near_resonant_amplitude(_FREQUENCY, _DETUNING, 1.0))
    speed = disturbed_speed(time, _FREQUENCY, _DETUNING, beta, 0.3, 0.012, 0.4)
    extreme = 0.5 * PERIOD * np.abs(speed - _FREQUENCY).max() / _FREQUENCY / 1e-7
    yield _row("the same, largest of (39) at 12 and 10 mrad", "order of nu", extreme, "1e-7 s", extreme > 20_000)
    scene = _resonant_scene()
    first, _, _, seconds, (n1, _) = _harmonics(scene)
    phase, worst = np.unwrap(np.angle(first)), 0.0
    for minutes in range(5, 31):
        part = seconds <= 60.0 * minutes
        slope = float(np.polyfit(seconds[part], phase[part], 1)[0])
        worst = max(worst, abs(REFERENCE * ((slope / n1) ** 2 - 1.0) / MGAL))
    yield _row("gravity from pendulum 1 alone", "impossible", worst, "mGal, worst of 5 to 30 min", worst > 100.0)
    found = errors(scene, "panteleev", "projection")
    for name, limit in (("panteleev", 0.01), ("projection", 0.001)):
        error = abs(found[name])
        yield _row(f"gravity from the difference, {name}", "possible", error, "mGal", error < limit)


def _leak() -> Iterator[Row]:
    """What psi adds to the phase speed by (9), as (14) says, at the minute marks; and what it does to gravity."""
    scene = two_pendulums("leak", 1e-4, gravity=REFERENCE)
    first, difference, slow, time, (n1, n2) = _harmonics(scene)
    sizes = np.abs(first), np.abs(difference), np.angle(first / difference)
    raw = leaking(n1, n2, *sizes, np.angle(difference), slow, np.gradient(slow, time[1], edge_order=2))
    every = round(MARK_SECONDS / time[1])
    leak = (raw - phase_speed(n1, n2, *sizes))[every::every] * 2.0 * scene.gravity / n2 / MGAL
    yield _row("leak of psi into (9), r.m.s. over the marks", "limits the method", rms(leak), "mGal", rms(leak) > 10.0)
    found = errors(scene, "vening-meinesz")["vening-meinesz"]
    yield _row("error of gravity by (9)", "limits the method", found, "mGal", abs(found) > 10.0)


def _harmonics(scene: Scene) -> tuple[Complexes, Complexes, Floats, Floats, Any]:
    """True harmonics of the first pendulum and of the difference, psi1, times and frequencies of a scene."""
    truth = simulate(scene)[1]
    known = {name: np.asarray(value.values) for name, value in truth["truth"].dataset.items()}
    first, second = known["free_amplitude"] * np.exp(1j * known["free_phase"])
    return first, first - second, known["forced"][0], np.asarray(truth["time"].values), known["frequency"]


def _film() -> Iterator[Row]:
    """psi1 - psi2 on the photograph, from a simulated record of one harmonic of swell."""
    for period, expected, told in ((10.0, 2e-5, "2e-5"), (2.0, 7e-4, "7e-4")):
        motion = {"kind": "harmonics", "amplitude": [0.1], "period": [period]}
        still: Any = {"amplitudes": (0.0, 0.0), "gravity": REFERENCE, "duration": 120.0}
        scene = two_pendulums("film", _DIFFERENCE / PERIOD, motion=[motion], **still)
        slow = np.asarray(simulate(scene)[1]["truth/forced"].values)
        size = _FILM * np.abs(slow[0] - slow[1]).max() / np.abs(slow[0]).max()
        claim = f"largest psi1-psi2 on film, psi 10 cm, T1-T2 = 1e-5 s, {period:g} s swell"
        yield _row(claim, f"below a few 1e-3 (checked form: {told})", size, "mm", abs(size / expected - 1.0) < 0.05)


_TERMS = {
    "first_speed": "neglected (n1-n2)(Phi1'-n1)",
    "first_growth": "neglected (n1-n2) Theta1'/Theta1",
    "forcing": "neglected (n1-n2) xi/g",
    "slow_difference": "neglected psi1-psi2",
    "damping_difference": "left out: gamma1-gamma2",
    "finite_arc": "left out: finite arc",
}


def _neglected() -> Iterator[Row]:
    """Validity figures from a record's separated harmonics: 12/6 mrad, swell of 75 mrad, a two-minute beat."""
    near = _resonant_scene().motion[0].model_dump(exclude_none=True)
    for eps, limit in ((1e-5, 0.01), (1e-4, 0.1)):
        own: Any = {"amplitudes": (0.012, 0.006), "damping_rates": (1e-4, 1.2e-4), "gravity": REFERENCE}
        scene = two_pendulums("neglected", eps, motion=[swell(SWELL, gravity=REFERENCE), near], **own)
        ready = prepared(scene)
        worth = neglected_terms(ready)
        for name, term in _TERMS.items():
            size, small = abs(worth[name]), term.startswith("neglected")
            said, agree = ("negligible", size < limit) if small else ("not treated", size > 0.01)
            yield _row(f"{term}, eps {eps:g}", said, worth[name], "mGal", agree)
        error = errors(scene, "projection")["projection"]
        yield _row(f"projection, which neglects none, eps {eps:g}", "-", error, "mGal", abs(error) < 0.001)
