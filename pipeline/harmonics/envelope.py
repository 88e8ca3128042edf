"""The envelope of a near-resonant harmonic, and the slow motion of the first pendulum beside it.

Of the envelope, by weighted least squares in windows: weighted by Kaiser, the series is fitted by {1, t} and
{1, t, t^2} x {cos, sin}: a harmonic with an amplitude and phase that may change quadratically, on a slow part. Where
all samples are there the fit is one set of filter taps, for all windows a few small matrix products; where samples are
missing the same fit is solved on those present, so a gap is never filled.

Of the slow motion, what it does to the phase speed of a swing. A support accelerated sideways turns the apparent
vertical by psi and strengthens it; heave changes it too. In the slow limit the swing about psi has the stiffness
`n^2 Gamma`,

    Gamma = (1 + zeta) / cos psi + tan psi psi''/n^2

(section 1.2 of the formula sheet). Its phase speed follows from Milne's equation to second order in the modulation,
`n [sqrt(Gamma) - (Gamma'/n)^2/32]`.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pipeline.arrays import Complexes, Floats

IMAGE_BEATS = 2.0  # beats with the image at the negative frequency that a window must hold to tell them apart
WINDOW_SECONDS = 16.0
HOP_SECONDS = 1.0
KAISER_SHAPE = 14.0
TERMS = 6  # of a window's fit that are looked at: not those of the amplitude's quadratic change
LEAST_COVERAGE = 0.7  # of a window's weight; an instant with less has no value
PASS, STOP = 0.5, 0.85  # of the swing's frequency
REJECTION = 80.0  # dB, of the swing: what is left of it is 1e-6 rad
COARSE = 6.0  # samples a swing that the slow motion needs


@dataclass(frozen=True)
class Envelope:
    """`theta(t) = Re[Z(t) exp(i n0 t)] + slow(t)` for the first pendulum and for the difference."""

    time: Floats  # (k,) uniform instants, s from the first sample of the record
    carrier: float  # n0, rad s-1
    first: Complexes  # (k,) Z1 relative to the carrier, rad; NaN where the window holds too few samples
    difference: Complexes  # (k,) D, the same
    first_speed: Complexes  # (k,) their time derivatives, rad s-1
    difference_speed: Complexes
    slow: Floats  # (2, k) slow part of first pendulum and difference, rad
    coverage: Floats  # (k,) share of the window's weight that held samples of the difference, 0 to 1
    samples: Floats  # (2,) of first pendulum and difference that each instant stands for (hop x rate x coverage)
    noise_gain: float  # variance of an envelope's component per variance of white reading noise, complete window
    taps: Complexes  # (m,) weights of a complete window's samples in the amplitude, counted from its own centre

    def influence(self, by_instant: Complexes, count: int, every: int) -> Floats:
        """Influence of each of `count` samples of the difference on `Re sum conj(by_instant) D`, (count,).

        Windows are `every` samples apart. Counting each instant's noise as white and round is right only where the
        image of the harmonic is far off.
        """
        out = np.zeros(count)
        for k, weight in enumerate(np.conj(by_instant) * np.exp(-1j * self.carrier * self.time)):
            out[k * every : k * every + self.taps.size] += (weight * self.taps).real
        return out

    @property
    def share(self) -> Complexes:
        """Z1/D, NaN where either is missing."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.where(self.difference == 0.0, np.nan, self.first / self.difference))

    @property
    def hop(self) -> float:
        """Distance of the instants, s."""
        return float(self.time[1] - self.time[0])


def image_distance(frequency: float, mean_step: float) -> float:
    """Distance of the harmonic from its image after sampling, rad s-1: 0.124 of 1.01 s read at half-second marks."""
    nyquist = np.pi / mean_step
    return float(abs((2.0 * frequency + nyquist) % (2.0 * nyquist) - nyquist))


def window_length(frequency: float, mean_step: float, duration: float) -> float:
    """Length of the window, s, longer where the image is near, at most a third of the record."""
    needed = IMAGE_BEATS * 2.0 * np.pi / max(image_distance(frequency, mean_step), 1e-9)
    return float(min(max(WINDOW_SECONDS, needed), duration / 3.0))


def fill(values: Complexes) -> Complexes:
    """Linear interpolation of an INPUT's envelope across missing instants (never of the difference)."""
    present = np.isfinite(values)
    if present.all():
        return values
    where = np.arange(values.size)
    return np.asarray(np.interp(where, where[present], values[present]))


def sliding_envelope(time: Floats, step: float, first: Floats, difference: Floats, frequency: float) -> Envelope:
    """Envelope of both series (n,), rad, NaN = missing, about a carrier of `frequency`, rad s-1.

    Its instants are `HOP_SECONDS` apart (further where the window must be long). Flat at the pendulum's frequency, and
    some 95 dB down where swell is.
    """
    length = window_length(frequency, step, float(time[-1]) + step)
    half = max(8, round(0.5 * length / step))
    every = max(1, round(HOP_SECONDS * max(1.0, length / WINDOW_SECONDS) / step))
    basis, weight, taps = window(half, step, frequency)
    fits = [fit_windows(series, basis, weight, taps, every) for series in (first, difference)]
    fit, coverage = (np.stack(each) for each in zip(*fits, strict=True))
    centres = (np.arange(fit.shape[2]) * every + half) * step
    carrier = np.exp(-1j * frequency * centres)
    amplitude: Complexes = (fit[:, 0] - 1j * fit[:, 1]) * carrier
    speed: Complexes = (fit[:, 4] - 1j * fit[:, 5]) * carrier / (half * step)
    return Envelope(
        time=centres, carrier=frequency, first=amplitude[0], difference=amplitude[1], first_speed=speed[0],
        difference_speed=speed[1], slow=fit[:, 2], coverage=coverage[1], samples=coverage.mean(axis=1) * every,
        noise_gain=float(0.5 * np.sum(np.square(taps[:2]))), taps=taps[0] - 1j * taps[1],
    )  # fmt: skip


@lru_cache(maxsize=2)  # records of one instrument have one window
def window(half: int, step: float, frequency: float) -> tuple[Floats, Floats, Floats]:
    """Basis (rows, 8), Kaiser weight (rows,) and taps (8, rows) of a window of `2 half + 1` samples."""
    x = np.arange(-half, half + 1) / half
    cos, sin = np.cos(frequency * half * step * x), np.sin(frequency * half * step * x)
    basis = np.stack([cos, sin, np.ones_like(x), x, x * cos, x * sin, x * x * cos, x * x * sin], axis=-1)
    weight = np.kaiser(x.size, KAISER_SHAPE)
    return basis, weight, weighted_inverse(basis, weight)


def weighted_inverse(basis: Floats, weight: Floats) -> Floats:
    """Taps (8, rows) that give the coefficients of a basis (rows, 8) by weighted least squares."""
    weighted = weight * basis.T
    return np.asarray(np.linalg.pinv(weighted @ basis) @ weighted)


def fit_windows(series: Floats, basis: Floats, weight: Floats, taps: Floats, every: int) -> tuple[Floats, Floats]:
    """Coefficients (6, k) of windows `every` samples apart, NaN where too little is there; coverage (k,)."""
    rows, terms = basis.shape
    hops, count = -(-rows // every), (series.size - rows) // every + 1
    # a window as so many stretches from one window's start to the next: one product for all of them
    laid, stretches = np.zeros((TERMS, hops * every)), np.zeros((count - 1 + hops) * every)
    laid[:, :rows] = taps[:TERMS]
    here = series[: stretches.size]
    stretches[: here.size] = here
    by_hop = laid.reshape(TERMS, hops, every).swapaxes(0, 1).reshape(-1, every)
    products = (by_hop @ stretches.reshape(-1, every).T).reshape(hops, TERMS, -1)
    out, coverage = np.zeros((TERMS, count)), np.ones(count)
    for hop, product in enumerate(products):
        out += product[:, hop : hop + count]
    for k in np.flatnonzero(np.isnan(out[0])):
        values = series[k * every : k * every + rows]
        present = np.isfinite(values)
        coverage[k] = weight[present].sum() / weight.sum()
        out[:, k] = np.nan
        if coverage[k] >= LEAST_COVERAGE and present.sum() >= 2 * terms:
            out[:, k] = weighted_inverse(basis[present], weight[present])[:TERMS] @ values[present]
    return out, coverage


@dataclass(frozen=True)
class SlowMotion:
    """psi and zeta at uniform instants."""

    begin: float  # first instant, s
    step: float  # s
    angle: Floats  # (k,) psi, rad
    curvature: Floats  # (k,) psi'', s-2
    zeta: Floats | None  # (k,) z''/g in the same band; None where none is recorded

    @property
    def time(self) -> Floats:
        """The instants, s."""
        return self.begin + self.step * np.arange(self.angle.size)

    def gamma(self, frequency: float) -> Floats:
        """Gamma at the instants."""
        up = 1.0 if self.zeta is None else 1.0 + self.zeta
        return np.asarray(up / np.cos(self.angle) + np.tan(self.angle) * self.curvature / frequency**2)

    def phase(self, frequency: float, time: Floats) -> Floats:
        """Phase that a swing of n = `frequency` gains over n t, rad, at other times; steady beyond the ends."""
        gamma = self.gamma(frequency)
        speed = frequency * (np.sqrt(gamma) - 1.0) - np.gradient(gamma, self.step) ** 2 / (32.0 * frequency)
        mean = float(speed.mean())
        gained = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) - mean) * self.step))
        return np.asarray(np.interp(time, self.time, gained) + mean * time)


def kaiser(count: int, rejection: float) -> Floats:
    """Kaiser's window with that rejection, dB > 50 (Kaiser 1974)."""
    return np.kaiser(count, 0.1102 * (rejection - 8.7))


def reach_of(width: float, step: float, rejection: float) -> int:
    """Half the length, in samples, of a Kaiser window with a transition of `width` rad s-1 (Kaiser 1974)."""
    return int(np.ceil((rejection - 8.0) / (2.285 * width * step) / 2.0))


def windowed(cut: float, reach: int, step: float, rejection: float) -> tuple[Floats, Floats, Floats]:
    """Taps of the low-pass at `cut` rad s-1, of its first derivative (s-1) and of its second (s-2), Kaiser-windowed."""
    time = step * np.arange(-reach, reach + 1, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        sine, cosine = np.sin(cut * time), np.cos(cut * time)
        low = sine / time
        slope = (cut * cosine - sine / time) / time
        bend = -(cut**2 * sine + 2.0 * cut * cosine / time - 2.0 * sine / time**2) / time
    low[reach], slope[reach], bend[reach] = cut, 0.0, -(cut**3) / 3.0
    window = kaiser(time.size, rejection) * step / np.pi
    return low * window, slope * window, bend * window


def slow_motion(theta: Floats, vertical: Floats | None, step: float, frequency: float, gravity: float) -> SlowMotion:
    """Separate the slow motion of the first pendulum, (n,), rad, whole, and of the heave z'', (n,), m s-2, if any."""
    every = max(1, int(2.0 * np.pi / (frequency * step) / COARSE))
    edge, stop, coarse = PASS * frequency, STOP * frequency, every * step
    # what folds onto the pass band where samples are left out must be gone
    before = reach_of(2.0 * np.pi / coarse - 2.0 * edge, step, REJECTION)
    first = windowed(np.pi / coarse, before, step, REJECTION)[0]
    after = reach_of(stop - edge, coarse, REJECTION)
    low, _, bend = windowed(0.5 * (edge + stop), after, coarse, REJECTION)

    def filtered(series: Floats, taps: Floats) -> Floats:
        return np.correlate(np.correlate(series, first / first.sum(), "valid")[::every], taps, "valid")

    return SlowMotion(
        begin=before * step + after * coarse,
        step=coarse,
        angle=filtered(theta, low / low.sum()),
        curvature=filtered(theta, bend - bend.sum() / low.sum() * low),
        zeta=None if vertical is None else filtered(vertical, low / low.sum()) / gravity,
    )
