"""What of the first pendulum and of heave enters the nonlinear identity; it does not change while that is fitted.

Filters give the first pendulum and its acceleration free of the noise above three times the swing, which would enter
the nonlinear terms squared: differentiated over the whole band of a 25 Hz record it shifts gravity by half a milligal.
Both have a linear phase, are windowed sincs (Kaiser), and are corrected so that their gain is exact, with its slope and
curvature, at zero and at the pendulum's frequency, and at that of swell, where nearly all of the motion is.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.arrays import Floats
from pipeline.harmonics.envelope import Envelope, fill

PASS, STOP = 3.0, 6.0  # times the swing's frequency: the nonlinear terms make lines up to the third
SWELL = 0.3  # of the swing's frequency: the upper end of swell
REJECTION = 150.0  # dB


class Filters(NamedTuple):
    """Taps over `2 reach + 1` samples; `out[k] = sum_j taps[j] theta[k - reach + j]`."""

    low: Floats
    """Low-pass, gain 1."""
    curvature: Floats
    """theta'' + 2 gamma theta', s-2."""
    reach: int
    """Samples lost at each end."""
    noise_low: float
    """Variance of the low-passed theta per variance of white noise."""
    noise_product: float
    """Covariance of both outputs per variance of white noise, s-2."""


@functools.lru_cache(maxsize=16)
def design(frequency: float, step: float, damping_rate: float, notch: bool = False) -> Filters:
    """Design both filters; with a notch the curvature's gain is zero at three times the swing, where noise is largest.

    Parameters
    ----------
    frequency : float
        Circular frequency of the swing, rad s-1.
    step : float
        s; six samples a swing at least, so that the third harmonic lies below the Nyquist frequency.
    damping_rate : float
        gamma1, s-1.
    """
    edge = PASS * frequency
    stop = min(STOP * frequency, 2.0 * np.pi / step - edge)  # what folds onto the pass band must be gone
    reach = reach_of(stop - edge, step)
    low, slope, bend = windowed(0.5 * (edge + stop), reach, step)
    bend -= bend.sum() / low.sum() * low  # the window's own curvature shifts the whole pass band alike
    age = np.linspace(-1.0, 1.0, 2 * reach + 1)
    length = reach * step
    swell, swing, third = (np.cos(share * frequency * length * age) for share in (SWELL, 1.0, PASS))
    sine = np.sin(frequency * length * age)
    # gains at zero, swell and swing; first and second derivatives of the gain at the swing, second at zero
    conditions = np.stack([np.ones_like(age), swell, swing, age * sine, age**2 * swing, age**2])
    low = _exact(low, conditions, np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
    bent = [0.0, -((SWELL * frequency) ** 2), -(frequency**2), 2.0 * frequency / length, *(2.0 / length**2,) * 2]
    if notch:
        conditions, bent = np.vstack([conditions, third]), [*bent, 0.0]
    bend = _exact(bend, conditions, np.array(bent))
    curvature = bend - 2.0 * damping_rate * slope  # odd, and the taps are correlated with theta, not convolved
    return Filters(low, curvature, reach, float(low @ low), float(low @ curvature))


def shape_of(rejection: float) -> float:
    """Shape of the Kaiser window with that rejection, dB > 50 (Kaiser 1974)."""
    return 0.1102 * (rejection - 8.7)


def reach_of(width: float, step: float, rejection: float = REJECTION) -> int:
    """Half the length, in samples, of a Kaiser window with a transition of `width` rad s-1 (Kaiser 1974)."""
    return int(np.ceil((rejection - 8.0) / (2.285 * width * step) / 2.0))


def windowed(cut: float, reach: int, step: float, rejection: float = REJECTION) -> tuple[Floats, Floats, Floats]:
    """Taps of the low-pass at `cut` rad s-1, of its first derivative (s-1) and of its second (s-2), Kaiser-windowed."""
    time = step * np.arange(-reach, reach + 1, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        sine, cosine = np.sin(cut * time), np.cos(cut * time)
        low = sine / time
        slope = (cut * cosine - sine / time) / time
        bend = -(cut**2 * sine + 2.0 * cut * cosine / time - 2.0 * sine / time**2) / time
    low[reach], slope[reach], bend[reach] = cut, 0.0, -(cut**3) / 3.0
    window = np.kaiser(time.size, shape_of(rejection)) * step / np.pi
    return low * window, slope * window, bend * window


def _exact(taps: Floats, conditions: Floats, wanted: Floats) -> Floats:
    """Smallest change of taps, in the weight of the Kaiser window, with which `conditions @ taps` are as wanted."""
    weighted = conditions * np.kaiser(taps.size, shape_of(REJECTION))
    return np.asarray(taps + weighted.T @ np.linalg.solve(conditions @ weighted.T, wanted - conditions @ taps))


@dataclass(frozen=True)
class Motion:
    """The first pendulum and heave, of the samples less the ends that the filters lose.

    Attributes
    ----------
    inside : slice
        These samples, in the record.
    low, bend : (m,) arrays
        theta1 free of the noise above three times the swing, rad; `n2^2 w = (theta1'' + 2 gamma1 theta1') / ratio^2`,
        s-2.
    vertical : (m,) array or None
        z'', m s-2, up positive.
    shift : float
        What the noise of theta1 that the filters let pass adds to the factor of sin d on average, s-2.
    third : bool
        Whether the third harmonic was computed from the swing instead of read.
    """

    inside: slice
    low: Floats
    bend: Floats
    vertical: Floats | None
    shift: float
    third: bool

    def pull(self, gravity: float) -> Floats:
        """1 + zeta."""
        return np.ones(self.low.size) if self.vertical is None else np.asarray(1.0 + self.vertical / gravity)


def motion(
    theta: Floats,
    vertical: Floats | None,
    step: float,
    frequency: float,
    ratio: float,
    damping_rate: float,
    noise: float,
    envelope: Envelope | None = None,
) -> Motion:
    """Filter the first pendulum.

    Parameters
    ----------
    theta : (n,) array
        First pendulum, rad, all samples, `step` seconds apart.
    vertical : (n,) array or None
        z'', m s-2.
    frequency, ratio, damping_rate : float
        n2 about which the filters are exact, rad s-1; n1/n2; gamma1, s-1.
    noise : float
        White reading noise of theta, rad (0 where not known).
    envelope : Envelope, optional
        Where it is given the swing's third harmonic is computed from it and not read: noise there comes back to the
        swing nine times as strong, and more of it than of any other.
    """
    filters = design(frequency * ratio, step, damping_rate, envelope is not None)
    inside = slice(filters.reach, theta.size - filters.reach)
    curved = np.correlate(theta, filters.curvature, "valid")
    if envelope is not None:
        time = step * np.arange(inside.start, inside.stop)
        curved -= (3.0 * frequency * ratio) ** 2 * third_harmonic(envelope, time)
    return Motion(
        inside=inside,
        low=np.correlate(theta, filters.low, "valid"),
        bend=curved * ratio**-2,
        vertical=None if vertical is None else vertical[inside],
        # mean of 1/cos theta1 and of theta1 w
        shift=noise**2 * (0.5 * frequency**2 * filters.noise_low + filters.noise_product * ratio**-2),
        third=envelope is not None,
    )


def third_harmonic(envelope: Envelope, time: Floats) -> Floats:
    """`-(A^3/192) cos 3 phi` of the first pendulum's swing, a real pendulum's own, at given times; rad."""
    cube = fill(envelope.first) ** 3 / -192.0
    slow = np.interp(time, envelope.time, cube.real) + 1j * np.interp(time, envelope.time, cube.imag)
    return np.asarray((slow * np.exp(3j * envelope.carrier * time)).real)
