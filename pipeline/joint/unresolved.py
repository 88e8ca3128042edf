"""What vertical motion does to gravity that is assumed but cannot be followed.

The path that is likeliest leaves out the variance about it. Vertical motion of circular frequency m slows a pendulum by
<zeta^2> / (4 (1 - m^2 / (4 n^2))) of gravity (Browne's vertical term): what the samples do not resolve of it does so
unseen. Its spectrum is that assumed, less what its sidebands beside the swing show above noise and horizontal motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.joint import spectrum
from pipeline.joint.explanation import Fitted
from pipeline.joint.problem import Assumed
from pipeline.joint.ship import Sea, density
from pipeline.joint.whiteness import CALM, Shown

FASTEST, PLACES = 60.0, 4000  # rad s-1, of a spectrum's even places; their number
WIDTHS = np.sinh(np.linspace(-6.0, 6.0, 121))  # of a component, at which places lie about its peak
NEAR = 0.05  # of (2 n)^2: so near it the swing's own width keeps the term finite
DOUBTED = 0.5  # share of the term that the assumed spectrum leaves uncertain
LEAST_MODES = 0.5
SHORT = (0.6, 0.8, 1.0, 1.25)  # of the swing's frequency, of short waves
BROAD = 0.3  # of theirs, a width
LIFTS = np.geomspace(
    0.1, 10.0, 9
)  # of what sways a ship so fast, what lifts it: hulls, and planes of swing, face any way


def unresolved(fit: Fitted, assumed: Assumed) -> tuple[float, float]:
    """Gravity over itself that is to be added for vertical motion not followed, and its 1 sigma.

    Parameters
    ----------
    fit : Fitted
        Whose swing and sampling count.
    assumed : Assumed
        Ship and noise.
    """
    problem = fit.model.problem
    upright = [each for each in assumed.ship if each.axis == "vertical"]
    if not upright or not problem.leaves_heave_open(assumed.sine):
        return 0.0, 0.0
    swing, lattice = problem.swing, problem.lattice
    about = [each.peak + getattr(each, "damping", each.peak) * WIDTHS for each in upright]
    frequency = np.unique(np.concatenate([np.linspace(0.01, FASTEST, PLACES), *about]))
    frequency = frequency[frequency > 0.0] * (1.0 + 1e-9)  # never twice the swing's own
    whole = density(assumed.ship, frequency, "vertical")
    shown = np.zeros(frequency.size)  # signal over noise, of all sidebands
    for trace, spacing in enumerate(lattice.spacing[: problem.traces]):
        swings = fit.path[:, : 2 * problem.pendulums : 2] @ lattice.combination[trace]
        for by in (swing, -swing):
            beside = np.abs(frequency + by)
            level = spectrum.transfer(problem, trace, beside) * density(assumed.ship, beside, "horizontal")
            signal = spectrum.beside_the_swing(swing, 0.5 * float(np.mean(swings**2)), beside) * whole
            shown += signal / (level + assumed.noise[trace] ** 2 * spacing)
    recorded = lattice.time[lattice.trace == problem.traces + 1]
    if recorded.size > 1:
        step = float(np.median(np.diff(recorded)))
        shown += np.where(frequency < np.pi / step, whole / (assumed.noise[problem.traces + 1] ** 2 * step), 0.0)
    away = 1.0 - frequency**2 / (4.0 * swing**2)
    left = whole / (1.0 + shown) * 0.25 * away / (away**2 + NEAR**2)
    size, square = np.trapezoid(np.abs(left), frequency), np.trapezoid(left**2, frequency)
    if not size:
        return 0.0, 0.0
    modes = max(lattice.duration / (2.0 * np.pi) * size**2 / square, LEAST_MODES)
    return float(np.trapezoid(left, frequency)) / np.pi, float(size) / np.pi * float(np.hypot(DOUBTED, modes**-0.5))


def unseen(fit: Fitted) -> tuple[float, float]:
    """The same for short waves that lift a ship and leave too little in the readings to be found, as it sways so fast.

    All sizes, from a tenth of what sways it to tenfold, are as likely beforehand; the errors weigh them.
    """
    assumed, problem = fit.model.assumed, fit.model.problem
    sways = [each for each in assumed.ship if each.axis == "horizontal" and each.peak > CALM * problem.swing]
    if not sways or not problem.leaves_heave_open(assumed.sine):
        return 0.0, 0.0
    size, shown = float(np.hypot.reduce([each.rms for each in sways])), Shown.of(fit)
    own, found = unresolved(fit, assumed)[0], []
    for frequency in problem.swing * np.array(SHORT):
        for rms in size * LIFTS:
            waves = Sea(float(frequency), BROAD * float(frequency), float(rms), "vertical")
            lifted = replace(assumed, ship=(*assumed.ship, waves))
            more, doubt = unresolved(fit, lifted)
            found.append((shown.gain(lifted), more - own, doubt))
    gain, more, doubt = np.transpose(found)
    share = np.exp(gain - gain.max())
    share /= share.sum()
    mean = float(share @ more)
    return mean, float(np.sqrt(max(share @ (more**2 + doubt**2) - mean**2, 0.0)))
