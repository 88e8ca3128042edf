"""One observation made ready: wild readings out, the first pendulum whole, intermediates made once, when asked for."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats, even_times, readings, variance
from pipeline.estimate import Budget, budget
from pipeline.gaps import LONG_GAP, bridge, missing_stretches
from pipeline.harmonics.blocks import block_envelope
from pipeline.harmonics.envelope import Envelope
from pipeline.harmonics.narrowband import NarrowbandFit, fit_narrowband
from pipeline.observation import Observation
from pipeline.outliers import MOST_ANGLE, reject_outliers
from pipeline.uneven_grid import grid_step, reject_uneven

if TYPE_CHECKING:
    from pipeline.harmonics.slow_motion import SlowMotion

LEAST_SWINGS = 20.0  # a shorter record has no window for the harmonic and no certainty of its phase
LEAST_EXPLAINED = 0.5  # share of the difference's power that its own swing must explain
LEAST_SWING, MOST_SWING = 1e-9, 10.0  # rad of the difference
LEAST_INSTANTS = 4  # of an envelope, for a swing to be followed
CAPTURE = 0.02  # relative departure from the nominal frequency beyond which the swing was not found


@dataclass(frozen=True)
class Prepared:
    """An observation made ready; intermediates are made once, when a method asks for them.

    Attributes
    ----------
    observation : Observation
        As it was read.
    whole, whole_step : (m,) array, float
        The first pendulum on a uniform grid of that step (s), its gaps bridged; the samples' own grid where they
        have one.
    noise_theta : float
        White noise of the first pendulum that neighbours leave unexplained, rad (NaN = could not be told).
    bridged : float
        Share of the first pendulum's samples that were bridged.
    bridges : float
        Root sum of squares over the bridges of predicted error times the samples it acts on, rad.
    short_bridges : float
        The same without long gaps.
    long_gaps : tuple of (int, int)
        First missing and next present point of `whole` of each gap longer than `LONG_GAP`.
    trials : dict
        What bridges of so many points err by, once it was tried; see `projection.cuts`. Shared by all copies.
    """

    observation: Observation
    whole: Floats
    whole_step: float
    noise_theta: float
    bridged: float
    bridges: float
    short_bridges: float = 0.0
    long_gaps: tuple[tuple[int, int], ...] = ()
    trials: dict[int, float] = field(default_factory=dict, repr=False, compare=False)
    _finer: dict[int, tuple[Floats, float, float]] = field(default_factory=dict, repr=False, compare=False)

    def finer(self, step: float, factor: int) -> Floats:
        """The first pendulum on a grid so many times finer than `step`; found once for all copies of this object.

        Copies differ in the difference alone, which turns the frequency that it is found with by next to nothing.
        """
        if factor not in self._finer:
            from pipeline.projection.upsample import upsample

            frequency = self.rough_first_frequency
            self._finer[factor] = upsample(self.observation.theta, step, frequency, factor, LONG_GAP / step)
        return self._finer[factor][0]

    def _hidden(self, cut: bool) -> float:
        """What bridges may hide, and missing marks where they had to be guessed, rad; `cut`: long gaps left out."""
        guess = max((spreads[cut] for _, *spreads in self._finer.values()), default=0.0)
        return float(np.hypot(self.short_bridges if cut else self.bridges, guess))

    @property
    def nominal(self) -> float:
        """n2 at reference gravity, rad s-1."""
        return float(self.observation.frequency_reference[1])

    def gravity_of(self, frequency: float) -> float:
        """Gravity of a trial n2 (rad s-1, in the record's own time) as the pendulums feel it, m s-2."""
        return self.observation.felt_gravity(frequency)

    @property
    def known_damping(self) -> float | None:
        """gamma2 where the record states it."""
        rates = self.observation.damping_rate
        return None if rates is None else float(rates[1])

    @cached_property
    def blocks(self) -> Envelope:
        """Cheap envelope, from which the exact fits start."""
        seen = self.observation
        return block_envelope(seen.time, seen.step, self.whole, seen.difference, self.nominal, self.whole_step)

    @cached_property
    def _cleaned(self) -> tuple[Floats, float]:
        seen = self.observation
        if seen.step is None:
            return seen.difference, float("nan")
        cleaned, _, noise = reject_outliers(seen.difference, seen.step, self.nominal)
        return cleaned, noise

    @cached_property
    def difference_on_grid(self) -> Floats:
        """The difference of uneven times on the grid of `whole`, rad; NaN where there are too few readings."""
        seen = self.observation
        return reject_uneven(seen.time, seen.difference, self.whole_step, self.nominal)[1]

    @property
    def clean_difference(self) -> Floats:
        """The difference without wild readings, rad; its gaps are kept."""
        return self._cleaned[0]

    @property
    def noise_difference(self) -> float:
        """White noise of the difference that neighbours leave unexplained, rad (NaN = could not be told)."""
        return self._cleaned[1]

    @cached_property
    def sliding(self) -> Envelope:
        """Separated harmonics by sliding least squares."""
        from pipeline.harmonics.sliding import sliding_envelope

        seen = self.observation
        return sliding_envelope(seen.time, seen.step, self.whole, self.clean_difference, self.nominal, self.whole_step)

    @cached_property
    def slow_motion(self) -> SlowMotion:
        """Slow part of the first pendulum and recorded heave."""
        from pipeline.harmonics.slow_motion import slow_motion

        seen = self.observation
        vertical = seen.vertical
        if vertical is not None and vertical.size != self.whole.size:
            vertical = np.interp(even_times(self.whole.size, self.whole_step), seen.time, vertical)
        return slow_motion(self.whole, vertical, self.whole_step, self.nominal, seen.reference_gravity)

    def narrowband(self, envelope: Envelope, tolerance: float = 1e-13) -> NarrowbandFit:
        """Complex form of (27) on an envelope."""
        seen = self.observation
        return fit_narrowband(
            envelope.time,
            envelope.difference,
            envelope.first,
            envelope.first_speed,
            envelope.coverage,
            carrier=envelope.carrier,
            ratio=seen.frequency_ratio,
            damping_rate=self.known_damping,
            damping_difference=seen.damping_difference,
            tolerance=tolerance,
        )

    @cached_property
    def fine(self) -> NarrowbandFit:
        """Complex form of (27) on the separated harmonics."""
        require_swing(self.sliding)
        return self.narrowband(self.sliding)

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
    def _pieces(self) -> list[slice]:
        """Instants of the cheap envelope between long gaps, if there are any."""
        edges = np.array([0.0, *(edge for gap in self.long_gaps for edge in gap), np.inf])
        at = np.searchsorted(self.blocks.time, edges * self.whole_step).tolist()
        return [slice(*bounds) for bounds in zip(at[::2], at[1::2], strict=True)] if self.long_gaps else []

    @cached_property
    def rough(self) -> NarrowbandFit:
        """Start of the exact fits, good to about 1e-3 mGal; from the longest piece where long gaps part the record."""
        require_swing(self.blocks)
        envelope, difference = self.blocks, self.blocks.difference
        if self._pieces:
            longest = max(self._pieces, key=lambda piece: readings(difference[piece].real))
            alone = np.full_like(difference, np.nan)
            alone[longest] = difference[longest]
            if readings(alone.real) >= LEAST_INSTANTS:
                envelope = replace(envelope, difference=alone)
        return self.narrowband(envelope, tolerance=1e-7)

    @property
    def rough_slope(self) -> float:
        """Slope of the difference's phase less the nominal frequency, uncorrected, rad s-1."""
        return self.rough.slope

    @property
    def rough_first_frequency(self) -> float:
        """n1, rad s-1."""
        return self.observation.frequency_ratio * self.rough.frequency

    def theta_error(self, shared: Budget, fallback: float, *, cut: bool = False) -> float:
        """1-sigma of n2 from the first pendulum, rad s-1; `shared` has the sensitivities, see `theta_error_of`."""
        return self.theta_error_of(shared.noise_theta, fallback, cut=cut)

    def theta_error_of(self, sensitivity: float, fallback: float, *, cut: bool = False) -> float:
        """1-sigma of n2 from the first pendulum, rad s-1: its reading noise and what its bridged gaps may hide.

        `sensitivity` is that to its white noise, s-1; `fallback` the noise taken where neither neighbours nor the
        record tell, rad. `cut`: what long gaps hide is reckoned elsewhere.
        """
        stated = self.observation.sigma_theta
        noise = self.noise_theta if np.isfinite(self.noise_theta) else fallback if stated is None else stated
        samples = (1.0 - self.bridged) * self.observation.theta.size
        # noise adds up as the root of the number of samples, the error of a bridge as the number
        return sensitivity * float(np.hypot(noise, self._hidden(cut) / np.sqrt(samples)))

    @cached_property
    def rough_budget(self) -> Budget:
        """Sensitivities, from the cheap envelope."""
        seen, fit = self.observation, self.rough
        return budget(self.blocks, fit, seen.frequency_ratio, seen.damping_difference, self._pieces)


def prepare(observation: Observation) -> Prepared:
    """Remove the first pendulum's wild readings and bridge its gaps.

    Raises
    ------
    RefusedError
        A series has too few samples, or the record is too short for any method.
    """
    nominal = float(observation.frequency_reference[1])
    swings = float(observation.time[-1]) * nominal / (2.0 * np.pi)
    if swings < LEAST_SWINGS:
        raise RefusedError(
            f"time: {swings:.1f} swings are too few to separate the pendulum's harmonic; "
            f"give at least {LEAST_SWINGS:.0f} swings ({LEAST_SWINGS * 2 * np.pi / nominal:.0f} s)"
        )
    for name, series in (("difference", observation.difference), ("first pendulum", observation.theta)):
        count = readings(series)
        if count < 2 * LEAST_SWINGS:
            raise RefusedError(f"record/elongation: the {name} has only {count} readings")
    theta, rejected, noise, bridges, short = observation.theta, 0, float("nan"), 0.0, 0.0
    if observation.step is not None:
        step = observation.step
        theta, rejected, noise = reject_outliers(theta, step, nominal)
        if step * nominal > MOST_ANGLE:
            from pipeline.projection.upsample import reject_at_marks

            theta, rejected = reject_at_marks(theta, step, nominal)
        whole = theta
    else:
        step = grid_step(observation.time, nominal)
        theta, whole, rejected, noise = reject_uneven(observation.time, theta, step, nominal)
    long_gaps = tuple(gap for gap in missing_stretches(whole) if (gap[1] - gap[0]) * step > LONG_GAP)
    if step * nominal < 0.5 * np.pi:
        filled, spans = bridge(whole, step, nominal, float(np.nan_to_num(noise)))
        if filled is not whole and readings(filled) < filled.size:
            raise RefusedError(
                "record/elongation: the first pendulum has a gap too long to bridge; split the record there"
            )
        whole = filled
        # an error in a bridge acts on the swing for about a radian; what further radians do adds up at random
        radian = 1.0 / (nominal * step)
        squares = np.array([length * min(length, radian) * error**2 for length, error in spans])
        is_short = [length * step <= LONG_GAP for length, _ in spans]
        bridges, short = float(np.sqrt(sum(squares))), float(np.sqrt(sum(squares[is_short])))
    return Prepared(
        observation=observation if theta is observation.theta else replace(observation, theta=theta),
        whole=whole,
        whole_step=step,
        noise_theta=noise,
        bridged=1.0 - (count - rejected) / theta.size,
        bridges=bridges,
        short_bridges=short,
        long_gaps=long_gaps,
    )


def slow_variance(prepared: Prepared) -> float:
    """Mean square of the first pendulum's slow motion, rad2; what is not its swing, whatever the sampling."""
    swing = 0.5 * float(np.nanmean(np.abs(prepared.blocks.first) ** 2))
    return max(variance(prepared.observation.theta) - swing, 0.0)


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
