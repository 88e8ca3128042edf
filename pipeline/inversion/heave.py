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
from pipeline.gaps import missing_stretches, rounded_up
from pipeline.inversion.iteration import Iteration
from pipeline.inversion.solve import InversionFit, solve

if TYPE_CHECKING:
    from pipeline.inversion.prepare import Inverted
    from pipeline.prepared import Prepared
    from pipeline.projection.solve import ProjectionFit

PASS, STOP = 0.25, 0.55  # of the swing's frequency: heave of a ship lies below a quarter of it
ROUNDS, MOST_ROUNDS = 4, 24  # each leaves a sixtieth of what lacked, at the band's edge far more
FALLS = 1e-3  # a round by which the residual falls no more was the last
SWEEPS = 4
GAP_RIDGE = 5e-3  # what the band tells by less of a gap is left to the next round, or at nought: it would be noise
GAP_ROUNDS, GAP_SETTLED = 30, 1e-6  # at most, and what may be left of what lacks in gaps
TRIALS = 24  # of gaps
MOST_HEAVE = 0.5  # of gravity
_BRIDGED = 2.5 * np.pi  # rad of swing, the longest gap that the band bridges without loss
_BESIDE = 10.0  # s of readings on both sides of a gap on trial
_SETTLED = 1e-12
_CALIBRATION = 0.1  # relative 1-sigma uncertainty of the noise that is taken off
LEAST_FOLLOWED = 0.2  # of heave at the band's edge, from which what was not followed can be told
_LOST = 0.3  # relative 1-sigma uncertainty of that
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


def driven(iteration: Iteration, zeta: Floats, low: Band) -> Complexes:
    """What drives the difference beside gravity, over its complex amplitude, s-1: the beat of unequal periods.

    The amplitude D obeys `D' = (i n zeta/2 - gamma) D + drive`.
    """
    step, frequency = iteration.motion.step, iteration.frequency
    swing = low.low(iteration.about * np.exp(-1j * frequency * step * np.arange(zeta.size)))
    return np.asarray(np.gradient(swing, step) / swing + iteration.damping_rate - 0.5j * frequency * zeta)


def lacking_speed(
    model: Floats, residual: Floats, frequency: float, step: float, low: Band, drive: Complexes | None = None
) -> Floats:
    """Phase speed that the model lacks, rad s-1, in the band; residual NaN = missing.

    `drive`, as `driven` tells it, acts on what lacks as well: the first pendulum is recorded, so that a beat keeps
    its phase when that of the difference is turned. Near a beat's least amplitude that is no small part.

    Across a gap the phase goes on as its band allows (Papoulis 1975).
    """
    carrier = np.exp(-1j * frequency * step * np.arange(model.size))
    swing = low.low(model * carrier)
    missing = np.isnan(residual)

    def phase(lack: Floats) -> Floats:
        return np.asarray((low.low(lack * carrier) / swing).imag)

    lack = np.where(missing, 0.0, residual)
    if missing.any():
        from scipy.sparse.linalg import LinearOperator, gmres

        turned = (-2.0 * swing[missing] * np.conj(carrier[missing])).imag  # Re(i phase swing) = phase * turned
        guess = np.zeros(lack.size)

        def unlike(values: Floats) -> Floats:
            guess[missing] = values
            return np.asarray((1.0 + GAP_RIDGE) * values - phase(guess)[missing] * turned)

        wanted = phase(lack)[missing] * turned
        operator = LinearOperator((wanted.size, wanted.size), matvec=unlike, dtype=np.float64)
        lack[missing], _ = gmres(operator, wanted, rtol=GAP_SETTLED, restart=GAP_ROUNDS, maxiter=1)
    lacks = low.low(lack * carrier) / swing
    speed = np.gradient(lacks.imag, step)
    return np.asarray(speed if drive is None else speed + (drive * lacks).imag)


def gap_error(
    model: Floats, residual: Floats, zeta: Floats, window: Floats, frequency: float, step: float, low: Band
) -> float:
    """1 sigma of n2, rad s-1, from gaps longer than the band bridges without loss.

    Gaps of the same lengths are laid where readings are; what the phase speed so loses of the zeta that was found and
    of the noise is what it loses in the record's own.
    """
    gaps = [gap for gap in missing_stretches(residual) if (gap[1] - gap[0]) * step > _BRIDGED / frequency]
    if not gaps:
        return 0.0
    speed = 0.5 * frequency * zeta
    carrier = np.exp(-1j * frequency * step * np.arange(model.size))
    lack = residual - 2.0 * np.cumsum(speed) * step * (low.low(model * carrier) * np.conj(carrier)).imag
    whole = lacking_speed(model, lack, frequency, step, low)
    side = int(_BESIDE / step)
    variance, known = 0.0, dict[int, float]()
    for start, stop in gaps:
        length = rounded_up(stop - start)
        if length not in known:
            broken, tried = lack.copy(), list[slice]()
            for place in np.linspace(0, lack.size, TRIALS, endpoint=False, dtype=np.int64).tolist():
                around = slice(place, place + length + 2 * side)
                if around.stop <= lack.size and not np.isnan(broken[around]).any():
                    broken[place + side : place + side + length] = np.nan
                    tried.append(around)
            lost = (1.0 + 0.5 * zeta) * (lacking_speed(model, broken, frequency, step, low) - whole)
            sums = [step * float(np.sum(lost[around])) for around in tried]
            # nothing to try it on: a step of the phase, of its length times a third of what heave does to the speed
            steps = np.array(sums) if sums else np.std(speed) * length * step / 3.0
            known[length] = float(np.mean(np.square(steps)))
        variance += (window[(start + stop) // 2] / step) ** 2 * known[length]
    return float(np.sqrt(variance))


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
    tall, followed = _followed(frequency, low, rounds)
    # phase = Im(lack/swing): one quadrature of twice the noise over the amplitude
    power = float(np.sum((followed * low.angular) ** 2 / tall)) / low.padded
    return 2.0 * noise**2 * inverse_square * power


def power_lost(
    zeta: Floats, window: Floats, inverse_square: float, noise: float, frequency: float, low: Band, rounds: int
) -> float:
    """Mean square of zeta at the band's edge that the rounds did not follow, each line weighed as heave acts.

    Told from what they did follow there, less the noise.
    """
    tall, followed = _followed(frequency, low, rounds)
    edge = (followed > LEAST_FOLLOWED) & (followed < 1.0)
    power = np.abs(np.fft.fft(np.sqrt(window) * zeta, low.padded)[edge]) ** 2
    power -= 8.0 * (followed / tall * low.angular / frequency)[edge] ** 2 * noise**2 * inverse_square
    return float(np.sum(tall[edge] * power * (followed[edge] ** -2 - 1.0))) / low.padded


def _followed(frequency: float, low: Band, rounds: int) -> tuple[Floats, Floats]:
    """By how much more a line acts than a slow one, and what share of it so many rounds follow."""
    # heave at m makes 1/(1 - m^2/4n^2) times its slow phase speed, and its mean square acts as much more
    tall = 1.0 / (1.0 - 0.25 * (low.angular / frequency) ** 2)
    return tall, 1.0 - (1.0 - low.gain * tall) ** rounds


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
    zeta, before = np.zeros(count), np.inf
    for number in range(1, MOST_ROUNDS + 1):
        residual = iteration.on_grid()
        drive = driven(iteration, zeta, low)
        speed = lacking_speed(iteration.about, residual, iteration.frequency, step, low, drive)
        zeta += 2.0 / iteration.frequency * speed
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
        if number >= ROUNDS and found.noise > (1.0 - FALLS) * before:
            break
        before = found.noise
    frequency = iteration.frequency
    noise = prepared.noise_difference if np.isfinite(prepared.noise_difference) else found.noise
    carrier = np.exp(-1j * frequency * step * np.arange(count))
    swing = 2.0 * low.low(iteration.about * carrier)  # complex amplitude
    amplitude = np.abs(swing)
    # where the grid holds more points than were read, the noise of the readings between them is shared
    shared = count / max(int(gram[4, 4]), 1)
    inverse_square = float(np.sum(window / amplitude**2)) * shared
    uneven = (frequency * prepared.observation.time_rate_sigma) ** 2
    taken = noise_power(inverse_square, noise, frequency, low, number) + _UNEVEN * uneven
    lost = 0.25 * frequency**2 * power_lost(zeta, window, inverse_square, noise, frequency, low, number)
    corrected = float(np.sqrt(frequency**2 - taken + lost))
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
                + (_CALIBRATION * 0.5 * taken / frequency) ** 2
                + (_LOST * 0.5 * lost / frequency) ** 2
                + (_UNEVEN_SIGMA * uneven / (2.0 * frequency)) ** 2
                + (0.5 * frequency * window_leak(zeta)) ** 2
                + numerical_error(prepared, iteration) ** 2
                + gap_error(iteration.about, residual, zeta, window, frequency, step, low) ** 2
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
