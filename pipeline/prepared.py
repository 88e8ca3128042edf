"""What a method is given, one observation made ready, and what it returns, an estimate.

An observation is refused where it has outliers; intermediates are made once, when asked for.

Each sample is compared with the fit of {1, t, t^2, t^3, cos, sin, t cos, t sin} through the half second on either side,
itself left out: what neighbours do not predict is an outlier, or white noise.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats, median_present
from pipeline.harmonics.envelope import Envelope, SlowMotion, sliding_envelope, slow_motion
from pipeline.harmonics.narrowband import Budget, NarrowbandFit, budget, fit_narrowband
from pipeline.observation import Observation

PLACES = 2000  # from which the scale is taken, at least
REACH_SECONDS = 0.5
LEAST_REACH = 6  # samples on each side
THRESHOLD, USUAL = 6.0, 45000  # robust sigmas; of so many Gaussian samples 1e-4 exceed it, of more no more shall
MOST_ANGLE = 0.5 * np.pi  # swing between samples; with fewer than four a swing neighbours predict nothing
FLOOR = 1e-6  # of the largest elongation: what departs less harms nothing
LEAST_SWINGS = 20.0  # a shorter record has no window for the harmonic and no certainty of its phase
LEAST_EXPLAINED = 0.5  # share of the difference's power that its own swing must explain
LEAST_SWING, MOST_SWING = 1e-9, 10.0  # rad of the difference
LEAST_INSTANTS = 4  # of an envelope, for a swing to be followed
COLOUR_SECONDS = 4.0  # length of the blocks in which a residual is compared with a swing
CAPTURE = 0.02  # relative departure from the nominal frequency beyond which the swing was not found


@dataclass(frozen=True)
class Prepared:
    """An observation made ready; intermediates are made once, when a method asks for them."""

    observation: Observation
    noise_theta: float = float("nan")  # white noise that neighbours leave unexplained, rad; NaN = not estimated
    noise_difference: float = float("nan")

    @property
    def nominal(self) -> float:
        """n2 at reference gravity, rad s-1."""
        return float(self.observation.frequency_reference[1])

    @property
    def known_damping(self) -> float | None:
        """gamma2 where the record states it."""
        rates = self.observation.damping_rate
        return None if rates is None else float(rates[1])

    @cached_property
    def sliding(self) -> Envelope:
        """Separated harmonics by sliding least squares."""
        seen = self.observation
        return sliding_envelope(seen.time, seen.step, seen.theta, seen.difference, self.nominal)

    @cached_property
    def slow_motion(self) -> SlowMotion:
        """Slow part of the first pendulum and recorded heave."""
        seen = self.observation
        self.require_whole("theta", "vertical")
        return slow_motion(seen.theta, seen.vertical, seen.step, self.nominal, seen.reference_gravity)

    def require_whole(self, *names: str) -> None:
        """Refuse series of the observation that lack samples."""
        for name in names:
            series = getattr(self.observation, name)
            if series is not None and (missing := np.count_nonzero(~np.isfinite(series))):
                stored = "vertical_acceleration" if name == "vertical" else "elongation"
                raise RefusedError(f"record/{stored}: {missing} readings are missing; use --method joint")

    @cached_property
    def fine(self) -> NarrowbandFit:
        """Complex form of (27) on the separated harmonics, from which the exact fits start."""
        require_swing(self.sliding)
        seen = self.observation
        return fit_narrowband(self.sliding, seen.frequency_ratio, seen.damping_difference, self.known_damping)

    @property
    def fine_explained(self) -> float:
        """Share of the difference's power that the complex form explains."""
        envelope = self.sliding
        present = np.isfinite(envelope.difference)
        power = float(np.sum(envelope.coverage[present] * np.abs(envelope.difference[present]) ** 2))
        return 1.0 - self.fine.squares / power

    @cached_property
    def fine_budget(self) -> Budget:
        """Sensitivities, from the separated harmonics."""
        return budget(self.sliding, self.fine, self.observation.frequency_ratio, self.observation.damping_difference)

    @cached_property
    def slow_square(self) -> float:
        """Mean square of the first pendulum's motion beside its swing, reading noise taken off, rad2."""
        envelope, seen = self.sliding, self.observation
        swing = (envelope.first * np.exp(1j * envelope.carrier * envelope.time)).real
        rest = seen.theta[np.rint(envelope.time / seen.step).astype(np.int64)] - swing
        return max(float(np.nanvar(rest)) - self.theta_error(1.0, 0.0) ** 2, 0.0)

    def theta_error(self, sensitivity: float, fallback: float) -> float:
        """1 sigma of n2, rad s-1, by its sensitivity to the first pendulum's noise; `fallback`, rad: none is known."""
        stated = self.observation.sigma_theta
        noise = self.noise_theta if np.isfinite(self.noise_theta) else fallback if stated is None else stated
        return sensitivity * noise


@dataclass(frozen=True)
class Estimate:
    """Frequency of the second pendulum, as one method has it, in the record's own time."""

    frequency: float  # circular, at infinitesimal arc, undamped, rad s-1
    uncorrected: float  # the same from the plain slope of the difference's phase, rad s-1
    sigma: float  # 1 sigma of `frequency` from reading noise, rad s-1
    noise: float  # 1-sigma residual of the difference, rad (equivalent white reading noise)
    damping_rate: float  # gamma2 used or fitted, s-1
    samples: int  # of the difference that were used
    residual_colour: float = 1.0  # power of the residual near the swing over white noise's of the same total
    shifts: Mapping[str, Floats] | None = None
    """Phases that the method took off the difference's, (k,) rad at the envelope's instants, by `correction.PARTS`;
    None: the frequency comes in another way."""
    finite_arc: float = 0.0  # part of the correction that is due to the finite arc, rad s-1
    acceleration_reduced: bool = False  # whether the support's acceleration was reduced as it acts on real pendulums
    of_mean: bool = False
    """Whether it is that of the mean of gravity over the record, and the periods' uncertainty is in `sigma`; else it is
    that of a phase's slope."""
    parts: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)
    """Entries of the ledger within the correction, by name: value and 1 sigma, mGal, and words."""
    shares: Mapping[str, float] = field(default_factory=lambda: {"reading": 1.0})
    """Of the square of `sigma`, by source; they add up to 1."""


def prepare(observation: Observation) -> Prepared:
    """Look at both series once; `RefusedError`: too few samples, outliers, or a record too short for any method."""
    nominal = float(observation.frequency_reference[1])
    swings = float(observation.time[-1]) * nominal / (2.0 * np.pi)
    if swings < LEAST_SWINGS:
        raise RefusedError(
            f"time: {swings:.1f} swings are too few to separate the pendulum's harmonic; "
            f"give at least {LEAST_SWINGS:.0f} swings ({LEAST_SWINGS * 2 * np.pi / nominal:.0f} s)"
        )
    noises = []
    for name, series in (("difference", observation.difference), ("first pendulum", observation.theta)):
        count = np.count_nonzero(np.isfinite(series))
        if count < 2 * LEAST_SWINGS:
            raise RefusedError(f"record/elongation: the {name} has only {count} readings")
        outliers, noise = outliers_and_noise(series, observation.step, nominal)
        if outliers:
            raise RefusedError(f"record/elongation: the {name} has outliers; use --method joint")
        noises.append(noise)
    return Prepared(observation, noise_theta=noises[1], noise_difference=noises[0])


def require_swing(envelope: Envelope) -> None:
    """Refuse a difference that has no usable envelope."""
    size = np.abs(envelope.difference[np.isfinite(envelope.difference)])
    if size.size and not LEAST_SWING < size.max() < MOST_SWING:
        raise RefusedError(
            f"record/elongation: the difference swings by {size.max():.3g} rad; check the unit and the traces"
        )
    if min(np.isfinite(envelope.difference).sum(), np.isfinite(envelope.first).sum()) < LEAST_INSTANTS:
        raise RefusedError(
            "record/elongation: too few stretches without gaps to follow the swing; give a longer or less broken record"
        )


def outliers_and_noise(series: Floats, step: float, frequency: float) -> tuple[bool, float]:
    """Whether a series (n,), rad, NaN = missing, `step` s apart, has outliers, and its white noise.

    What lies beside a missing sample is not judged; the noise is what the neighbours leave unexplained (1 sigma, rad;
    NaN where they predict nothing).
    """
    reach = max(LEAST_REACH, round(REACH_SECONDS / step))
    if series.size < 6 * reach or step * frequency > MOST_ANGLE:
        return False, float("nan")
    taps = leave_one_out(reach, step, frequency)
    error = np.abs(np.correlate(series, taps, "valid"))
    scale = median_present(error[:: max(1, error.size // PLACES)]) / 0.6745
    threshold = np.sqrt(THRESHOLD**2 + 2.0 * np.log(max(error.size / USUAL, 1.0)))
    outliers = np.fmax.reduce(error) > max(threshold * scale, FLOOR * np.fmax.reduce(np.abs(series)))
    return bool(outliers), scale / float(np.linalg.norm(taps))


@lru_cache(maxsize=4)  # records of one instrument have one
def leave_one_out(reach: int, step: float, frequency: float) -> Floats:
    """Taps that give sample minus the fit through its neighbours (symmetric, the middle tap is 1)."""
    x = np.linspace(-1.0, 1.0, 2 * reach + 1)
    cos, sin = np.cos(frequency * reach * step * x), np.sin(frequency * reach * step * x)
    basis = np.stack([np.ones_like(x), x, x * x, x**3, cos, sin, x * cos, x * sin], axis=-1)
    prediction = basis[reach] @ np.linalg.pinv(np.delete(basis, reach, axis=0))
    return np.insert(-prediction, reach, 1.0)
