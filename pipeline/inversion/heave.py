"""Vertical acceleration that nobody recorded, told from the phase speed of the difference itself.

Heave changes the stiffness of both pendulums alike, and the phase of the difference runs faster and slower with it.
Its mean square shifts gravity by `-<z''^2>/(4 g (1 - m^2/4n^2))`, a hundred milligals in a seaway. Milne's equation
turns the measured phase speed into the stiffness; here the same is done by iteration on the exact model: what phase
the model still lacks, differentiated in a low band, is the missing `zeta n/2`; with it the model is run again. The
model so carries every bias of the estimator and takes it off. n2 is no longer found from the phase's slope, which zeta
can follow, but from the condition that zeta has no mean under a Hann window. Noise looks like heave: its mean square
in the band is known and taken off. So do times that run unevenly, as a film's: they turn both pendulums' phases by
n dt, but shift gravity by nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Complexes, Floats
from pipeline.inversion.iteration import Iteration
from pipeline.inversion.solve import InversionFit, solve

if TYPE_CHECKING:
    from pipeline.inversion.prepare import Inverted
    from pipeline.prepared import Prepared
    from pipeline.projection.solve import ProjectionFit

PASS, STOP = 0.25, 0.55  # of the swing's frequency: heave of a ship lies below a quarter of it
ROUNDS = 4  # each leaves a sixtieth of what lacked
SWEEPS = 4
GAP_ROUNDS = 8  # each leaves less than half of what lacks in a gap of 0.6 s
MOST_HEAVE = 0.5  # of gravity
_SETTLED = 1e-12
_CALIBRATION = 0.1  # relative 1-sigma uncertainty of the noise that is taken off
_UNEVEN, _UNEVEN_SIGMA = 0.5, 0.3  # part of the times' unevenness that lies in the band of heave: any, alike likely


@dataclass(frozen=True)
class Band:
    """A low-pass on the inversion's grid, in the frequency domain."""

    padded: int
    gain: Floats
    """(padded,) of the FFT's frequencies."""
    angular: Floats
    """(padded,) rad s-1."""

    def low(self, values: Complexes) -> Complexes:
        """Low-passed values."""
        return np.asarray(np.fft.ifft(np.fft.fft(values, self.padded) * self.gain)[: values.size])


def band(count: int, step: float, frequency: float) -> Band:
    """Low-pass with a smooth edge from `PASS` to `STOP` of the swing's frequency."""
    reach = int(np.ceil(60.0 / (frequency * step)))
    padded = 1 << int(np.ceil(np.log2(count + 2 * reach)))
    angular = 2.0 * np.pi * np.fft.fftfreq(padded, step)
    place = np.clip((np.abs(angular) / frequency - PASS) / (STOP - PASS), 0.0, 1.0)
    # smooth of all orders, so that the response dies out quickly
    with np.errstate(divide="ignore", over="ignore"):
        gain = 1.0 / (1.0 + np.exp(1.0 / (1.0 - place) - 1.0 / place))
    return Band(padded, gain, angular)


def lacking_speed(model: Floats, residual: Floats, frequency: float, step: float, low: Band) -> Floats:
    """Phase speed that the model lacks, rad s-1, in the band; residual NaN = missing.

    Across a gap the phase goes on as its band allows (Papoulis 1975).
    """
    carrier = np.exp(-1j * frequency * step * np.arange(model.size))
    swing = low.low(model * carrier)
    present = np.isfinite(residual)
    lack = np.where(present, residual, 0.0)
    phase = np.asarray((low.low(lack * carrier) / swing).imag)
    if not present.all():
        turned = -2.0 * swing[~present] * np.conj(carrier[~present])
        for _ in range(GAP_ROUNDS):
            lack[~present] = phase[~present] * turned.imag  # Re(i phase swing)
            phase = np.asarray((low.low(lack * carrier) / swing).imag)
    return np.asarray(np.gradient(phase, step))


def gap_error(residual: Floats, zeta: Floats, frequency: float, step: float) -> float:
    """1 sigma of n2, rad s-1, from gaps longer than the band can bridge.

    A gap hides a step of the phase of about its length times a third of what heave does to the phase speed, and
    a step in mid-record tilts the phase by 3/2 of it over the length.
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([0], np.isnan(residual).astype(np.int8), [0]))))
    lengths = (edges[1::2] - edges[::2]) * step - np.pi / (0.5 * (PASS + STOP) * frequency)
    steps = 0.5 * frequency * float(np.std(zeta)) * lengths[lengths > 0.0] / 3.0
    return 1.5 * float(np.sqrt(np.sum(steps**2))) / (residual.size * step)


def window_leak(zeta: Floats) -> float:
    """1 sigma of the mean under a Hann window of a zeta that has none in the long run.

    A line of k cycles in the record leaves at most 1/(pi k (k^2 - 1)) of itself, half of that (in mean square) over
    all phases; lines are told apart under the same window.
    """
    count = zeta.size
    window = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2
    # of a line in a Hann window three bins hold 3/2 of its power
    lines = 4.0 / count * np.abs(np.fft.rfft(window * zeta))[2:] / np.sqrt(1.5)
    cycles = np.arange(2, lines.size + 2)
    return float(np.sqrt(0.5 * np.sum((lines / (np.pi * cycles * (cycles**2 - 1.0))) ** 2)))


def noise_power(inverse_square: float, noise: float, frequency: float, low: Band, rounds: int) -> float:
    """Mean square of the phase speed that white reading noise makes in the band, each line weighed as heave acts."""
    # heave at m makes 1/(1 - m^2/4n^2) times its slow phase speed, and its mean square acts as much more
    tall = 1.0 / (1.0 - 0.25 * (low.angular / frequency) ** 2)
    followed = 1.0 - (1.0 - low.gain * tall) ** rounds
    # phase = Im(lack/swing): one quadrature of twice the noise over the amplitude
    power = float(np.sum((followed * low.angular) ** 2 / tall)) / low.padded
    return 2.0 * noise**2 * inverse_square * power


def with_heave(
    prepared: Prepared, iteration: Iteration, fit: InversionFit, start: ProjectionFit, fit_damping: bool
) -> Inverted:
    """Go on from a fit without heave: find zeta, and n2 from its vanishing mean.

    Raises
    ------
    RefusedError
        No heave of a ship explains what the model lacks.
    """
    from pipeline.inversion.prepare import Inverted, numerical_error, theta_sigma, whole_residual

    step, count = iteration.motion.step, iteration.about.size
    low = band(count, step, iteration.frequency)
    window = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2
    window /= window.sum()
    free = [0, 1, 2, 3, 4] if fit_damping else [0, 1, 2, 4]
    zeta = np.zeros(count)
    for _ in range(ROUNDS):
        residual = iteration.on_grid()
        zeta += 2.0 / iteration.frequency * lacking_speed(iteration.about, residual, iteration.frequency, step, low)
        mean = float(np.sum(window * zeta))
        zeta -= mean
        iteration.frequency *= float(np.sqrt(1.0 + mean))
        iteration.motion.heave = zeta
        for _ in range(SWEEPS):
            iteration.sweep()
            gram, _ = iteration.moments(fit.limit)
            found = solve(gram, free)
            iteration.improve(found.change)
            if abs(found.change[2]) < _SETTLED * iteration.frequency:
                break
        if float(np.abs(zeta).max()) > MOST_HEAVE:
            raise RefusedError(
                "difference: its residual has structure that neither arcs nor heave explain; "
                "check instrument/restoring and the traces"
            )
    frequency = iteration.frequency
    noise = prepared.noise_difference if np.isfinite(prepared.noise_difference) else found.noise
    carrier = np.exp(-1j * frequency * step * np.arange(count))
    swing = 2.0 * low.low(iteration.about * carrier)  # complex amplitude
    amplitude = np.abs(swing)
    # where the grid holds more points than were read, the noise of the readings between them is shared
    shared = count / max(int(gram[4, 4]), 1)
    inverse_square = float(np.sum(window / amplitude**2)) * shared
    uneven = (frequency * prepared.observation.time_rate_sigma) ** 2
    taken = noise_power(inverse_square, noise, frequency, low, ROUNDS) + _UNEVEN * uneven
    corrected = float(np.sqrt(frequency**2 - taken))
    # n2^2 is the mean square of the phase speed under the window, which heave makes vary;
    # a reading moves the phase by Im(2 e^{-int}/swing)
    tilt = -np.gradient(window * (1.0 + 0.5 * zeta), step)
    influence = 2.0 * tilt * (carrier / swing).imag
    own = noise * float(np.sqrt(np.sum(influence**2) * shared))
    return Inverted(
        frequency=corrected,
        damping_rate=iteration.damping_rate,
        sigma=float(
            np.sqrt(
                own**2
                + theta_sigma(prepared, iteration, influence, noise) ** 2
                + (_CALIBRATION * (frequency - corrected)) ** 2
                + (_UNEVEN_SIGMA * uneven / (2.0 * frequency)) ** 2
                + (0.5 * frequency * window_leak(zeta)) ** 2
                + numerical_error(prepared, iteration) ** 2
                + gap_error(residual, zeta, frequency, step) ** 2
            )
        ),
        noise=found.noise,
        colour=1.0,
        samples=int(gram[4, 4]),
        heave=float(np.sqrt(max(float(np.var(zeta)) - 4.0 * taken / frequency**2, 0.0))),
        start=start,
        residual=whole_residual(prepared, iteration, fit.limit),
        freedom=float(low.gain.sum()) * count / low.padded,
    )
