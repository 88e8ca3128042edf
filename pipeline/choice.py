"""`auto`: the cheapest adequate method, chosen from what the record says and, where it does not say, from residuals."""

from __future__ import annotations

import numpy as np

from pipeline.harmonics.envelope import Complexes, fill
from pipeline.harmonics.narrowband import fit_narrowband
from pipeline.methods.phases import passes_zero
from pipeline.prepared import Prepared

DECISIVE = 10.0  # difference of log likelihood
NEGLIGIBLE_ARC = 0.01  # mGal


def choose(prepared: Prepared) -> tuple[str, str]:
    """Name of the method, and the reason in words."""
    seen = prepared.observation
    if seen.restoring == "linear":
        return "projection", "the record says restoring = linear: the linear identity is exact"
    envelope = prepared.sliding
    arcs = arc_forcing(envelope.first, envelope.difference, prepared.nominal)
    squares = {}
    frequency = {}
    for name, forcing in (("linear", None), ("arc", arcs)):
        fit = fit_narrowband(
            envelope.time,
            envelope.difference,
            envelope.first,
            envelope.first_speed,
            envelope.coverage,
            carrier=envelope.carrier,
            ratio=seen.frequency_ratio,
            damping_rate=prepared.known_damping,
            damping_difference=seen.damping_difference,
            forcing=forcing,
        )
        squares[name], frequency[name] = fit.squares, fit.frequency
    shift = 2e5 * seen.reference_gravity * abs(frequency["arc"] - frequency["linear"]) / prepared.nominal
    if shift < NEGLIGIBLE_ARC:
        return "projection", f"the finite arc amounts to {shift:.4f} mGal only: the linear identity is adequate"
    # neighbouring instants share most of their window: about one in six is independent, with two components
    independent = float(np.isfinite(envelope.difference).sum()) / 6.0
    likelihood = independent * float(np.log(squares["arc"] / squares["linear"]))
    if likelihood > DECISIVE:
        return "projection", f"linear pendulums leave the smaller residual (log likelihood ratio {likelihood:.0f})"
    if passes_zero(np.abs(envelope.difference)):
        return "projection", "the amplitude passes near zero, where only exact forms hold; its finite arc is not reduced"
    if likelihood < -DECISIVE:
        return "general", f"finite arcs leave the smaller residual (log likelihood ratio {-likelihood:.0f})"
    return "general", "residuals do not tell linear from finite arcs; real pendulums have the sine"


def arc_forcing(first: Complexes, difference: Complexes, frequency: float) -> Complexes:
    """`-(i n/16) (|Z1|^2 Z1 - |Z2|^2 Z2)`: the finite arc as a forcing of the difference, rad s-1."""
    first, difference = fill(first), fill(difference)
    second = first - difference
    return np.asarray(-1j * frequency / 16.0 * (np.abs(first) ** 2 * first - np.abs(second) ** 2 * second))
