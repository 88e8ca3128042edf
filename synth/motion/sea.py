"""A wind sea: JONSWAP or Pierson-Moskowitz spectrum, carried down to the vessel's depth.

    S(x) = x^-5 exp(-5/4 x^-4) G^exp(-(x - 1)^2/(2 s^2)),  x = w/w_peak,  s = 0.07 below the peak, 0.09 above

G = 3.3 for JONSWAP and 1 for Pierson-Moskowitz. The spectrum is scaled so that the whole of it, 0 to
infinity, has the given significant height (Hasselmann et al. 1973 fix alpha = 0.0081 as well; the three
conflict). In deep water, k = w^2/g, a wave of amplitude a moves a vessel at depth d with an acceleration
of amplitude a w^2 exp(-k d), horizontal and vertical.
"""

from __future__ import annotations

import math

import numpy as np

from data_schemas.scene_motion import SeaMotion
from synth.motion.harmonic_sum import HarmonicSum
from synth.phase import Floats

PEAK_FACTOR = {"jonswap": 3.3, "pierson-moskowitz": 1.0}
LOWEST = 0.5  # Lowest frequency of a sea, as a multiple of the peak's: below it lies 2e-9 of the variance

_TOP = 40.0  # end of the numerical integral; beyond it the spectrum is x^-5 and its integral x^-4/4
_POINTS = 20_001


def spectral_shape(relative_frequency: Floats, peak_factor: float) -> Floats:
    """S(x) of the formula above for x = w/w_peak above 0, without the scale; the peak factor is G."""
    x = relative_frequency
    width = np.where(x <= 1, 0.07, 0.09)
    peak = np.exp(-((x - 1) ** 2) / (2 * width**2))
    return np.asarray(x**-5 * np.exp(-1.25 * x**-4) * peak_factor**peak)


def bin_variances(edges: Floats, spectrum: str, significant_height: float) -> Floats:
    """Variance of the sea's elevation in bins of frequency, m^2.

    The edges of the bins are multiples of the peak frequency, increasing, from LOWEST to at most 40; the spectrum is a
    key of PEAK_FACTOR; the significant height four times the rms elevation of the whole spectrum, m.
    """
    x = np.geomspace(LOWEST / 2, _TOP, _POINTS)
    density = spectral_shape(x, PEAK_FACTOR[spectrum])
    below = np.concatenate([[0.0], np.cumsum(np.diff(x) * (density[1:] + density[:-1]) / 2)])
    whole = below[-1] + _TOP**-4 / 4
    return np.asarray(np.diff(np.interp(edges, x, below)) / whole * (significant_height**2 / 16))


def sea(term: SeaMotion, gravity: float, chance: np.random.Generator) -> HarmonicSum:
    """Draw a sea.

    The bins are equally wide; the frequency of each harmonic is drawn evenly inside its bin, so that the record does
    not repeat itself, and its phase at random. Its amplitude follows from the variance of its bin. Gravity, m/s^2, is
    for the wave number.
    """
    peak = 2 * math.pi / term.peak_period
    edges = np.linspace(LOWEST, term.cutoff, term.components + 1)
    elevation = np.sqrt(2 * bin_variances(edges, term.spectrum, term.significant_height))
    rate = peak * (edges[:-1] + np.diff(edges) * chance.random(term.components))
    phase = 2 * math.pi * chance.random(term.components)
    at_depth = elevation * rate**2 * np.exp(-(rate**2) / gravity * term.depth)
    # on the orbits of deep water the vertical acceleration leads the horizontal by a quarter, whatever the direction
    slant = math.radians(term.direction)
    share = {"vertical": 1j, "horizontal": math.cos(slant), "transverse": math.sin(slant)}[term.axis]
    return HarmonicSum(rate, share * at_depth * np.exp(1j * phase))
