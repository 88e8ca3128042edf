"""`projection` and `shooting`: least squares on the exact identities that eliminate the support's acceleration.

`projection` takes the pendulums as linear, `shooting` as real ones with finite arcs and the support's acceleration.

Filters give the first pendulum and its acceleration free of the noise above three times the swing, which would enter
the nonlinear terms squared: differentiated over the whole band of a 25 Hz record it shifts gravity by half a milligal.
Both have a linear phase, are windowed sincs (Kaiser), and are corrected so that their gain is exact, with its slope and
curvature, at zero and at the pendulum's frequency, and at that of swell, where nearly all of the motion is.
"""

from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.harmonics.envelope import Envelope, fill, kaiser, reach_of, windowed
from pipeline.methods.identity import Fit, Identity
from pipeline.observation import Observation
from pipeline.prepared import COLOUR_SECONDS, LEAST_EXPLAINED, Estimate, Prepared

FINE_ANGLE = 0.8  # swing between readings, at most: eight readings a swing
NOISY = 3e-4  # reading noise of the first pendulum over its swing, from which its third harmonic is better computed
COLOURED = 3.0  # power of the residual near the swing over white, from which the identity does not fit
EXCESS = 2.0  # residual over the reading noise, the same
FLOOR = 1e-5  # of the amplitude: a smaller residual shows nothing
RIPPLE, COARSE, ORDER = 3e-9, 5e-6, 8
"""Numerical error, in parts of the strength of the nonlinear terms: the filters' ripple, and the quadrature's, which
grows with that power of the swing's turn between samples; measured on simulated records (five motions, six rates)."""
PASS, STOP = 3.0, 6.0  # times the swing's frequency: the nonlinear terms make lines up to the third
SWELL = 0.3  # of the swing's frequency: the upper end of swell
REJECTION = 150.0  # dB


def require_clean(prepared: Prepared) -> None:
    """Refuse what the exact identities, which integrate both series, do not take."""
    angle = prepared.observation.step * prepared.nominal
    if angle > FINE_ANGLE:
        raise RefusedError(f"time: {2.0 * np.pi / angle:.1f} readings a swing are fewer than eight; use --method joint")
    prepared.require_whole("theta", "difference", "vertical")


def linear_fit(prepared: Prepared) -> Fit:
    """The linear identity fitted to a record, the damping held where it is stated."""
    identity = Identity(prepared.observation, prepared.fine.frequency, slice(None))
    return identity.fit(prepared.fine.damping_rate, fit_damping=prepared.known_damping is None)


def projection(prepared: Prepared) -> Estimate:
    """Fit n2 with n1/n2 held, the damping held where the record states it."""
    require_clean(prepared)
    fit, rough = linear_fit(prepared), prepared.fine.model
    swing = 0.5 * float(np.vdot(rough, rough).real) / rough.size
    explained = swing / (swing + fit.noise**2)
    if explained < LEAST_EXPLAINED:
        raise RefusedError(
            f"difference: a swing at the nominal period explains only {100 * max(explained, 0.0):.0f} % of it; "
            "check instrument/period and that the trace is a difference of two pendulums"
        )
    from_theta = prepared.theta_error(prepared.fine_budget.noise_theta, fit.noise)
    return as_estimate(prepared, fit, residual_colour(fit, prepared), from_theta)


def as_estimate(prepared: Prepared, fit: Fit, colour: float, *others: float, reduced: bool = False) -> Estimate:
    """A fit with the noise of its own residual, coloured as it is, and other parts of its 1 sigma of n2, rad s-1."""
    own = float(np.linalg.norm(fit.influence)) * fit.noise * np.sqrt(max(colour, 1.0))
    return Estimate(
        frequency=fit.frequency, uncorrected=float(np.hypot(prepared.nominal + prepared.fine.slope, fit.damping_rate)),
        sigma=float(np.linalg.norm([own, *others])), noise=fit.noise, damping_rate=fit.damping_rate,
        samples=fit.residual.size, residual_colour=colour, acceleration_reduced=reduced,
    )  # fmt: skip


def residual_colour(fit: Fit, prepared: Prepared) -> float:
    """Power of the residual in blocks near the pendulum's frequency over that of white noise of the same total."""
    if fit.noise == 0.0:
        return 1.0
    step = prepared.observation.step
    rows = max(4, round(COLOUR_SECONDS / step))
    blocks: Floats = fit.residual[: fit.residual.size // rows * rows].reshape(-1, rows)
    power = np.abs(blocks @ np.exp(-1j * fit.frequency * step * np.arange(rows))) ** 2
    # |sum r e^{-int}|^2 has mean sigma^2 N for white noise
    return float(np.mean(power) / rows / fit.noise**2)


def shooting(prepared: Prepared) -> Estimate:
    """Fit n2 with n1/n2 held; vertical acceleration from the record, or none; of linear pendulums `projection`."""
    if prepared.observation.restoring == "linear":
        return projection(prepared)
    require_clean(prepared)
    return invert(prepared)


def invert(prepared: Prepared) -> Estimate:
    """Invert the nonlinear identity; `RefusedError`: no swing at the nominal period, outliers, or unrecorded heave."""
    moved, fit = nonlinear_fit(prepared)
    colour = residual_colour(fit, prepared)
    # short heave lies beside what the colour looks at, but above what neighbours call noise
    coloured = colour > COLOURED or (colour > 1.0 and fit.noise > EXCESS * prepared.noise_difference)
    if prepared.observation.vertical is None and coloured and fit.noise > FLOOR * float(np.abs(fit.model).max()):
        raise RefusedError(
            "record/vertical_acceleration: not recorded, and the residual is not that of real pendulums on a support "
            "that does not heave; use --method joint"
        )
    from_theta = prepared.theta_error(float(np.linalg.norm(moved.influence(fit))), fit.noise)
    numerical = numerical_error(fit, prepared.observation.step)
    return as_estimate(prepared, fit, colour, from_theta, numerical, reduced=True)


def nonlinear_fit(prepared: Prepared) -> "tuple[Motion, Fit]":
    """The identity of real pendulums fitted to a record, the damping held where it is stated."""
    seen, rough, envelope = prepared.observation, prepared.fine, prepared.sliding
    noise = prepared.theta_error(1.0, 0.0)
    # the third harmonic is read where the samples give it better than the swing's amplitude does
    read = noise < NOISY * float(np.nanmedian(np.abs(envelope.first)))
    moved = motion(seen, rough.frequency, rough.damping_rate, noise, None if read else envelope)
    return moved, moved.fit(rough.damping_rate, fit_damping=prepared.known_damping is None)


def numerical_error(fit: Fit, step: float) -> float:
    """What filters, quadrature and interpolation may do to n2, rad s-1."""
    strength = float(np.sqrt(np.mean(fit.stiffness**2))) / (2.0 * fit.frequency)
    return strength * (RIPPLE + COARSE * (fit.frequency * step) ** ORDER)


def design(frequency: float, step: float, damping_rate: float, notch: bool = False) -> tuple[Floats, Floats]:
    """Filters for a swing of `frequency`, rad s-1, that is sampled six times at least, and gamma1, s-1.

    Taps of the low-pass, gain 1, and of `theta'' + 2 gamma theta'`, s-2, each over `2 reach + 1` samples.
    With a notch the curvature's gain is zero at three times the swing, where noise is largest.
    """
    edge = PASS * frequency
    stop = min(STOP * frequency, 2.0 * np.pi / step - edge)  # what folds onto the pass band must be gone
    reach = reach_of(stop - edge, step, REJECTION)
    low, slope, bend = windowed(0.5 * (edge + stop), reach, step, REJECTION)
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
    return low, bend - 2.0 * damping_rate * slope  # slope is odd, and the taps are correlated


def _exact(taps: Floats, conditions: Floats, wanted: Floats) -> Floats:
    """Smallest change of taps, in the weight of the Kaiser window, with which `conditions @ taps` are as wanted."""
    weighted = conditions * kaiser(taps.size, REJECTION)
    return np.asarray(taps + weighted.T @ np.linalg.solve(conditions @ weighted.T, wanted - conditions @ taps))


@dataclass(frozen=True)
class Motion(Identity):
    """The same of real pendulums: first pendulum and heave, of the samples less the ends that the filters lose."""

    filters: tuple[Floats, Floats]
    low: Floats  # (m,) theta1 free of the noise above three times the swing, rad
    bend: Floats  # (m,) `n2^2 w = (theta1'' + 2 gamma1 theta1') / ratio^2`, s-2
    shift: float  # what the noise of theta1 that the filters pass adds to the factor of sin d on average, s-2

    def stiffness(self, frequency: float) -> Floats | float:
        """`n2^2 (1 + zeta)`, s-2; heave's part does not depend on n2."""
        square = frequency**2
        if self.observation.vertical is None:
            return square
        return np.asarray(
            square + square / self.observation.felt_gravity(frequency) * self.observation.vertical[self.inside]
        )

    def expand(self, angle: Floats, frequency: float) -> tuple[Floats, Floats, Floats]:
        """`N(d) = h^2 d - n2^2 F(d)` of real pendulums and its derivatives by d and n2, see `Identity`."""
        cosine, sine = np.cos(self.low), np.sin(angle)
        less = -2.0 * np.sin(0.5 * angle) ** 2  # cos d - 1
        lever = (self.stiffness(frequency) + self.bend * np.sin(self.low)) / cosine - self.shift
        by_angle = self.held**2 - lever * (1.0 + less) + self.bend * sine
        return self.held**2 * angle - lever * sine - self.bend * less, by_angle, -2.0 * frequency * sine / cosine

    def influence(self, fit: Fit) -> Floats:
        """d n2 / d (sample of the first pendulum), s-1, of the whole record, from a fit of the difference."""
        by, adjoint, out = fit.weights, fit.adjoint[2:], np.zeros(self.observation.theta.size)
        driven, source = (np.convolve(adjoint, taps)[3:-3] for taps in (by.driven, by.source))
        out[self.inside] = driven + by.direct * np.convolve(adjoint, by.swing)
        # what of the nonlinear terms comes from the first pendulum as it is, and from its acceleration
        tangent, sine = np.tan(self.low), np.sin(fit.model)
        plain = -(self.stiffness(fit.frequency) * np.sin(self.low) + self.bend) / np.cos(self.low) ** 2 * sine
        bent = (2.0 * np.sin(0.5 * fit.model) ** 2 - tangent * sine) / self.observation.frequency_ratio**2
        out += sum(map(np.convolve, (source * plain, source * bent), self.filters))
        return -out


def motion(
    observation: Observation, frequency: float, damping_rate: float, noise: float, envelope: Envelope | None = None
) -> Motion:
    """Filter the first pendulum of a whole observation, exactly about h = `frequency`.

    `noise` is its white reading noise, rad (0 where not known). Where an envelope is given the swing's third harmonic
    is computed from it and not read: noise there comes back to the swing nine times as strong.
    """
    own, ratio = frequency * observation.frequency_ratio, observation.frequency_ratio
    damping_rate += observation.damping_difference
    low, curvature = filters = design(own, observation.step, damping_rate, envelope is not None)
    inside = slice(low.size // 2, observation.theta.size - low.size // 2)
    curved = np.correlate(observation.theta, curvature, "valid")
    if envelope is not None:
        curved -= (3.0 * own) ** 2 * third_harmonic(envelope, observation.time[inside])
    passed = 0.5 * frequency**2 * low @ low + low @ curvature * ratio**-2
    return Motion(
        observation=observation,
        held=frequency,
        inside=inside,
        filters=filters,
        low=np.correlate(observation.theta, low, "valid"),
        bend=curved * ratio**-2,
        shift=noise**2 * float(passed),  # mean of 1/cos theta1 and of theta1 w
    )


def third_harmonic(envelope: Envelope, time: Floats) -> Floats:
    """`-(A^3/192) cos 3 phi` of the first pendulum's swing, a real pendulum's own, at given times; rad."""
    slow = np.interp(time, envelope.time, fill(envelope.first) ** 3 / -192.0)
    return np.asarray((slow * np.exp(3j * envelope.carrier * time)).real)
