"""What the reader of a result must know: each flag has a name, a condition and a reason."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import readings
from pipeline.estimate import Estimate
from pipeline.gravity import MGAL, Gravity
from pipeline.methods.phases import passes_zero
from pipeline.prepared import Prepared

SHORT_SECONDS = 300.0  # below it the near-resonant beat and the damping are not told from the frequency
MOST_MISSING = 0.3  # share of the difference's samples
MOST_BRIDGED = 0.1  # share of the first pendulum's samples
NOISE_ABOVE, NOISE_BELOW = 1.3, 0.7  # found over stated
COLOUR = 1.6  # power near the pendulum's frequency over white
COLOUR_FLOOR = 3e-4  # of the amplitude: a residual below it is the method's, not the readings'
LEAST_BROWNE = 0.05  # mGal of horizontal acceleration
IMPLAUSIBLE = (9.75, 9.85)  # m s-2; at sea gravity lies between 9.77 and 9.84

DAMPING_ASSUMED = "damping-difference-assumed"
"""Raised here and, where it leaves a doubt, by `pipeline.sensors`."""
MEANINGS = {
    "beats-through-zero": "the difference's amplitude passes near zero; phase methods mean nothing there",
    "short-record": f"shorter than {SHORT_SECONDS:.0f} s",
    "many-gaps": f"more than {100 * MOST_MISSING:.0f} % of the difference, or {100 * MOST_BRIDGED:.0f} % of the first "
    "pendulum, is missing",
    "frequency-difference-unresolved": "the stated uncertainty of n1-n2 costs more than the reading noise",
    "noise-above-stated": "residual noise above the stated reading noise",
    "noise-below-stated": "residual noise below the stated reading noise",
    "residual-not-white": "the residual has structure near the pendulum's frequency; sigma is widened by it",
    "gravity-implausible": "gravity outside 9.75 to 9.85 m/s2; check instrument/period and reference_gravity",
    "acceleration-not-reduced": "the support's acceleration changes the period of real pendulums and is not reduced",
    "correction-without-uncertainty": "a correction larger than sigma is made from inputs that state no uncertainty; "
    "sigma takes it as exact",
    DAMPING_ASSUMED: "no damping is stated and the pendulums decay; their difference is told from the "
    "record, or taken as nought where it does not tell; sigma holds the doubt",
}
JOINT = {
    "random-kicks": "the pendulums' phases walk at random (air, knife edge); sigma holds it",
    "gravity-changes": "gravity changes over the record: see group course; gravity is its mean",
    "friction-not-viscous": "friction that is not viscous was found and reduced",
    "errors-not-white": "the prediction errors exceed every explanation tried; sigma is widened by it",
}
"""Raised by `joint` alone."""
MEANINGS.update(JOINT)
UNDECIDED = "restoring-undecided"
"""Raised by `auto` alone: neither the record nor its residual tells linear pendulums from real ones."""
LINEAR_FITS = "linear-fits-better"
"""Raised by `shooting` alone, asked for by name, where no law is stated and heave was told from the phase."""
MEANINGS[LINEAR_FITS] = "linear pendulums explain the record better; state instrument attribute restoring"
MEANINGS[UNDECIDED] = "linear or real pendulums? the arcs' share is in sigma; state instrument attribute restoring"
SENSORS = {
    "traces-exchanged": "the first pendulum's trace and the difference's stood in each other's place; put right",
    "traces-sign": "the first trace has the wrong sign (or the two periods are exchanged); put right as a sign",
    "traces-time-offset": "the first trace is late or early against the difference; put right, see the attributes",
    "traces-time-offset-or-damping": "the first trace is late or early, or the damping of the two differs, which is "
    "not stated; put right as a time offset, which serves either",
    "traces-gain": "the first trace's scale is wrong (or n1-n2 is); put right, see the attributes",
}
"""Raised before any method, by `pipeline.sensors`."""
MEANINGS.update(SENSORS)
_DECAY = 3e-6  # s-1: one per cent of it as a difference costs about 0.01 mGal at a relative period difference of 1e-4


def flags(prepared: Prepared, estimate: Estimate, value: Gravity) -> list[str]:
    """Flags of one method on one record, in the order of `MEANINGS`."""
    seen = prepared.observation
    amplitude = np.abs(prepared.blocks.difference)
    raised = {
        "beats-through-zero": passes_zero(amplitude),
        "short-record": float(seen.time[-1]) < SHORT_SECONDS,
        "many-gaps": 1.0 - readings(seen.difference) / seen.difference.size > MOST_MISSING
        or prepared.bridged > MOST_BRIDGED,
        "frequency-difference-unresolved": _unresolved(prepared, value),
        "gravity-implausible": not IMPLAUSIBLE[0] < value.gravity < IMPLAUSIBLE[1],
        DAMPING_ASSUMED: seen.damping_rate is None and _decays(prepared, estimate),
        "acceleration-not-reduced": _accelerated(prepared, estimate, value),
        "correction-without-uncertainty": any(
            entry.applied and np.isnan(entry.sigma) and abs(entry.value) > value.sigma for entry in value.given.values()
        ),
        **_noise(prepared, estimate, float(np.nanmedian(amplitude))),
    }
    return [name for name in MEANINGS if raised.get(name)]


def _unresolved(prepared: Prepared, value: Gravity) -> bool:
    uncertainty = float(np.hypot(*prepared.observation.period_relative_uncertainty))
    cost = abs(value.per_ratio) * uncertainty / 1e-7
    noise = 2.0 * value.gravity / 1e-5 * value.frequency_sigma / value.frequency[1]
    return cost > noise


def _accelerated(prepared: Prepared, estimate: Estimate, value: Gravity) -> bool:
    """Browne's `<x''^2>/(2 g)` with x'' = -g psi, against sigma; only where the pendulums are taken for real ones."""
    if estimate.acceleration_reduced:
        return False
    if prepared.observation.restoring != "sine" and estimate.finite_arc == 0.0:
        return False
    slow = prepared.blocks.slow[0]
    size = 0.5 * value.gravity * float(np.nanvar(slow)) / MGAL
    return size > max(value.sigma, LEAST_BROWNE)


def _decays(prepared: Prepared, estimate: Estimate) -> bool:
    uncertainty = max(estimate.sigma, 1e-12)  # frequency and damping rate have the same standard deviation
    return estimate.damping_rate > max(_DECAY, 5.0 * uncertainty)


def _noise(prepared: Prepared, estimate: Estimate, amplitude: float) -> dict[str, bool]:
    stated = prepared.observation.sigma_difference
    allowance = 5.0 / np.sqrt(2.0 * estimate.samples)  # of the estimate itself
    found = estimate.noise if stated is None else estimate.noise / stated
    colour = estimate.residual_colour
    blocks = float(prepared.blocks.time.size)
    rises = colour > COLOUR + 5.0 / np.sqrt(blocks)
    visible = estimate.noise * np.sqrt(max(colour, 1.0)) > COLOUR_FLOOR * amplitude
    return {
        "noise-above-stated": stated is not None and found > NOISE_ABOVE + allowance,
        "noise-below-stated": stated is not None and found < NOISE_BELOW - allowance,
        "residual-not-white": rises and visible,
    }
