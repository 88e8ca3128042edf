"""`auto`: the cheapest adequate method, chosen from what the record says and, where it does not say, from residuals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Complexes, Floats
from pipeline.harmonics.envelope import fill
from pipeline.harmonics.narrowband import running_integral
from pipeline.methods.phases import passes_zero
from pipeline.prepared import Prepared
from pipeline.projection.sampling import problem
from pipeline.projection.solve import ProjectionFit, fit_projection

DECISIVE = 10.0  # difference of log likelihood
NEGLIGIBLE_ARC = 0.01  # mGal


def choose(prepared: Prepared) -> tuple[str, str]:
    """Name of the method, and the reason in words.

    Where the record does not state `restoring`, the exact linear identity is fitted twice: to the difference as it
    is, and to the difference less its response to the finite arcs. The smaller residual decides; where the record
    says "sine" it must be smaller decisively to overrule it.
    """
    seen = prepared.observation
    if seen.restoring == "linear":
        return "projection", "the record says restoring = linear: the linear identity is exact"
    linear = _fit(prepared)
    bent = replace(prepared, observation=replace(seen, difference=seen.difference - arc_response(prepared)))
    arc = _fit(bent)
    shift = 2e5 * seen.reference_gravity * abs(arc.frequency - linear.frequency) / prepared.nominal
    if shift < NEGLIGIBLE_ARC:
        return "projection", f"the finite arc amounts to {shift:.4f} mGal only: the linear identity is adequate"
    likelihood = 0.5 * (arc.samples * np.log(arc.noise**2) - linear.samples * np.log(linear.noise**2))
    likelihood -= 0.5 * (arc.samples - linear.samples) * np.log(linear.noise**2)
    told = f"log likelihood ratio {abs(likelihood):.3g}"
    if likelihood > (DECISIVE if seen.restoring == "sine" else 0.0):
        return "projection", f"linear pendulums leave the smaller residual ({told})"
    if passes_zero(np.abs(prepared.blocks.difference)):
        return (
            "projection",
            "the amplitude passes near zero, where only exact forms hold; its finite arc is not reduced",
        )
    if likelihood < -DECISIVE:
        return "general", f"finite arcs leave the smaller residual ({told})"
    return "general", f"residuals hardly tell linear pendulums from finite arcs ({told}); real pendulums have the sine"


def _fit(prepared: Prepared) -> ProjectionFit:
    rough = prepared.rough
    return fit_projection(problem(prepared), rough.frequency, rough.damping_rate, prepared.known_damping is None)


def arc_response(prepared: Prepared) -> Floats:
    """What the finite arcs add to the difference, rad, at the samples; zero at the first instant of the envelope."""
    seen, envelope, rough = prepared.observation, prepared.sliding, prepared.rough
    forcing = arc_forcing(envelope.first, envelope.difference, rough.frequency)
    mu = 1j * (rough.frequency - envelope.carrier) - rough.damping_rate
    growth = np.exp(mu * (envelope.time - envelope.time[0]))
    response = growth * running_integral(forcing / growth, envelope.hop)
    at = np.clip(seen.time, envelope.time[0], envelope.time[-1])
    smooth = np.interp(at, envelope.time, response.real) + 1j * np.interp(at, envelope.time, response.imag)
    smooth += (seen.time - at) * (np.where(seen.time > at, forcing[-1], forcing[0]))
    return np.asarray((smooth * np.exp(1j * envelope.carrier * seen.time)).real)


def arc_forcing(first: Complexes, difference: Complexes, frequency: float) -> Complexes:
    """`-(i n/16) (|Z1|^2 Z1 - |Z2|^2 Z2)`: the finite arc as a forcing of the difference, rad s-1."""
    first, difference = fill(first), fill(difference)
    second = first - difference
    return np.asarray(-1j * frequency / 16.0 * (np.abs(first) ** 2 * first - np.abs(second) ** 2 * second))
