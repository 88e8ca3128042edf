"""`auto`: the cheapest adequate method, chosen from what the record says and, where it does not say, from residuals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Complexes, Floats
from pipeline.harmonics.envelope import fill
from pipeline.harmonics.narrowband import running_integral
from pipeline.methods.phases import passes_zero
from pipeline.prepared import Prepared
from pipeline.projection.sampling import problem
from pipeline.projection.solve import ProjectionFit, fit_projection

DECISIVE = 5.0  # difference of log likelihood: odds of 150 to 1
NEGLIGIBLE_ARC = 0.01  # mGal
TOLD = 0.1  # 1 sigma of the third harmonic, as a share of what a sine law makes, from which it tells
FLOOR = 1e-5  # of the difference's amplitude: what the separated harmonics leave of the arcs is not told below it


@dataclass(frozen=True)
class Choice:
    """The method, the reason in words, and what the choice may be wrong by (1 sigma, rad s-1 of n2)."""

    method: str
    reason: str
    doubt: float = 0.0


def choose(prepared: Prepared) -> Choice:
    """Choose for a record.

    What the record states of `restoring` is obeyed. Where it states nothing, the exact linear identity is fitted
    twice: to the difference as it is, and to the difference less its response to the finite arcs. The smaller residual
    decides; where it is not decisively smaller the arcs' share goes into sigma.
    """
    seen = prepared.observation
    if seen.restoring == "linear":
        return Choice("projection", "the record says restoring = linear: the linear identity is exact")
    envelope = prepared.sliding
    inside = (seen.time >= envelope.time[0]) & (seen.time <= envelope.time[-1])
    shown = np.where(inside, seen.difference, np.nan)
    linear = _fit(replace(prepared, observation=replace(seen, difference=shown)))
    arc = linear
    for _ in range(3):  # the arcs' response turns with the frequency that it helps to find
        bent = shown - arc_response(prepared, arc.frequency, arc.damping_rate)
        arc = _fit(replace(prepared, observation=replace(seen, difference=bent)))
    change = abs(arc.frequency - linear.frequency)
    shift = 2e5 * seen.reference_gravity * change / prepared.nominal
    if shift < NEGLIGIBLE_ARC:
        return Choice("projection", f"the finite arc amounts to {shift:.4f} mGal only: the linear identity is adequate")
    real = "projection" if passes_zero(np.abs(prepared.blocks.difference)) else "general"
    if seen.restoring == "sine":
        return Choice(real, "the record says restoring = sine" + _beats(real))
    share, error = third_harmonic(linear.residual, prepared)
    if error < TOLD:
        seen_share = f"{share:.2f} of a real pendulum's third harmonic is there"
        return Choice(real if share > 0.5 else "projection", seen_share + (_beats(real) if share > 0.5 else ""))
    floor = FLOOR * float(np.nanmax(np.abs(prepared.blocks.difference)))
    likelihood = linear.samples * float(np.log(np.hypot(arc.noise, floor) / np.hypot(linear.noise, floor)))
    told = f"log likelihood ratio {abs(likelihood):.3g}"
    doubt = 0.0 if abs(likelihood) > DECISIVE else change
    hardly = "hardly " if doubt else ""
    if likelihood > 0.0:
        return Choice("projection", f"linear pendulums leave the {hardly}smaller residual ({told})", doubt)
    return Choice(real, f"finite arcs leave the {hardly}smaller residual ({told})" + _beats(real), doubt)


def _beats(method: str) -> str:
    if method == "general":
        return ""
    return "; the amplitude passes near zero, where only exact forms hold: the finite arc is not reduced"


def _fit(prepared: Prepared) -> ProjectionFit:
    rough = prepared.rough
    return fit_projection(problem(prepared), rough.frequency, rough.damping_rate, prepared.known_damping is None)


def arc_response(prepared: Prepared, frequency: float, gamma: float) -> Floats:
    """What the finite arcs add to the difference, rad, at the samples within the envelope's span; zero at its start."""
    seen, envelope = prepared.observation, prepared.sliding
    forcing = arc_forcing(envelope.first, envelope.difference, frequency)
    mu = complex(-gamma, frequency - envelope.carrier)
    growth = np.exp(mu * (envelope.time - envelope.time[0]))
    response = growth * running_integral(forcing / growth, envelope.hop)
    at = np.clip(seen.time, envelope.time[0], envelope.time[-1])
    smooth = np.interp(at, envelope.time, response.real) + 1j * np.interp(at, envelope.time, response.imag)
    return np.asarray((smooth * np.exp(1j * envelope.carrier * seen.time)).real)


def third_harmonic(residual: Floats, prepared: Prepared) -> tuple[float, float]:
    """How much of the third harmonic `-(A^3/192) cos 3 phi` of real pendulums a residual holds, and its 1 sigma.

    0 for linear pendulums, 1 for the sine law; sigma is infinite where the sampling cannot show it.
    """
    seen, envelope = prepared.observation, prepared.sliding
    if residual.size != seen.time.size:
        return 0.0, np.inf
    first, second = fill(envelope.first), fill(envelope.first - envelope.difference)
    cube = first**3 - second**3
    smooth = np.interp(seen.time, envelope.time, cube.real) + 1j * np.interp(seen.time, envelope.time, cube.imag)
    pattern = -(smooth * np.exp(3j * envelope.carrier * seen.time)).real / 192.0
    present = np.isfinite(residual)
    power = float(np.sum(pattern[present] ** 2))
    noise = float(np.std(residual[present]))
    if power == 0.0:
        return 0.0, np.inf
    return float(np.sum(pattern[present] * residual[present]) / power), noise / float(np.sqrt(power))


def arc_forcing(first: Complexes, difference: Complexes, frequency: float) -> Complexes:
    """`-(i n/16) (|Z1|^2 Z1 - |Z2|^2 Z2)`: the finite arc as a forcing of the difference, rad s-1."""
    first, difference = fill(first), fill(difference)
    second = first - difference
    return np.asarray(-1j * frequency / 16.0 * (np.abs(first) ** 2 * first - np.abs(second) ** 2 * second))
