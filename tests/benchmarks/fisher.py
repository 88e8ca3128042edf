"""Cramer-Rao bound of gravity, from the full Fisher matrix of the frequency of the second pendulum.

No kernel is shared with the estimators. Both recorded series are noisy: with theta1 an unknown function of its own,
read with white noise sigma1, and the difference `d = L theta1 + free swing + offset` read with sigma2, the parameters
(A, B, offset, n2 and, where it is not stated, gamma2) have, after theta1 is eliminated,

    F = J^T C^-1 J,    C = sigma2^2 I + sigma1^2 L L^T,    J = d(L theta1 + free swing + offset)/d(parameters)

at the true theta1. L is the exact linear identity's response (n1/n2 and gamma1 - gamma2 held),
`L f = (1-r) f + Im[chi int exp(lam (t-s)) f ds]`; here a trapezoidal sum, J by central differences, C^-1 J by conjugate
gradients. In the limit n1 = n2 the bound is `sqrt(24/(N (N^2-1))) sigma fs/a`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import fftconvolve
from scipy.sparse.linalg import LinearOperator, cg

from data_schemas.scene import Scene
from data_schemas.scene_recording import Recording
from pipeline.arrays import Floats
from pipeline.conditions import MGAL
from synth import simulate

_STEP = 1e-7  # of the frequency, for central differences
_TOLERANCE = 1e-8  # of the residual of conjugate gradients
_MOST_ROUNDS = 2000
FINEST = 25.0  # Hz; the trapezoidal sum wants twenty samples a swing


@dataclass(frozen=True)
class Pair:
    """Two linear pendulums as the difference sees them."""

    frequency: float
    """n2, rad s-1."""
    ratio: float
    """n1/n2."""
    damping_rate: float
    """gamma2, s-1."""
    damping_difference: float
    """gamma1 - gamma2, s-1."""
    swing: complex
    """A - iB of the free swing `Re[(A - iB) exp(lam t)]` of the difference, rad."""

    @property
    def eigenvalue(self) -> complex:
        """lam = -gamma2 + i w."""
        return complex(-self.damping_rate, np.sqrt(self.frequency**2 - self.damping_rate**2))


def respond(pair: Pair, theta: Floats, step: float, *, adjoint: bool = False) -> Floats:
    """`L theta`, causal, starting at rest, or what its transpose makes of `theta`; (n,) array, rad."""
    r = pair.ratio**-2
    lam = pair.eigenvalue
    drag = 2.0 * (pair.damping_rate - r * (pair.damping_rate + pair.damping_difference))
    chi = ((1.0 - r) * lam**2 + drag * lam) / lam.imag
    answer = (chi * np.exp(lam * step * np.arange(theta.size))).imag * step
    answer[0] *= 0.5  # trapezoid: the present moment counts half, and so does the first, below
    if adjoint:
        whole = fftconvolve(theta[::-1], answer)[theta.size - 1 :: -1]
        whole[0] -= 0.5 * float(answer @ theta)
    else:
        whole = fftconvolve(theta, answer)[: theta.size] - 0.5 * theta[0] * answer
    return np.asarray((1.0 - r) * theta + whole)


def _model(pair: Pair, theta: Floats, step: float, every: int) -> Floats:
    time = np.arange(theta.size) * step
    return np.asarray((respond(pair, theta, step) + (pair.swing * np.exp(pair.eigenvalue * time)).real)[::every])


def jacobian(pair: Pair, theta: Floats, step: float, every: int = 1, *, damping_known: bool = True) -> Floats:
    """Slopes of the noise-free difference by (n2, Re swing, Im swing, offset[, gamma2]) at readings, (n, 4 or 5)."""

    def slope(name: str, size: float) -> Floats:
        up = replace(pair, **{name: getattr(pair, name) + size})
        down = replace(pair, **{name: getattr(pair, name) - size})
        return (_model(up, theta, step, every) - _model(down, theta, step, every)) / (2.0 * size)

    time = np.arange(theta.size)[::every] * step
    growth = np.exp(pair.eigenvalue * time)
    columns = [slope("frequency", _STEP * pair.frequency), growth.real, -growth.imag, np.ones(time.size)]
    if not damping_known:
        columns.append(slope("damping_rate", _STEP * pair.frequency))
    return np.stack(columns, axis=-1)


def bound(
    pair: Pair, theta: Floats, step: float, sigma_theta: float, sigma_difference: float, *, every: int = 1,
    damping_known: bool = True,
) -> float:  # fmt: skip
    """Least standard deviation of n2 that an unbiased estimator can have, rad s-1.

    Parameters
    ----------
    theta : (n,) array
        True elongation of the first pendulum, rad, with at least twenty samples a swing (the trapezoid).
    step : float
        Its step, s.
    sigma_theta, sigma_difference : float
        White reading noise of the two series, rad.
    every : int
        Readings are every so many samples of `theta`.
    """
    columns = jacobian(pair, theta, step, every, damping_known=damping_known)
    reading = step * every

    def covariance(values: Floats) -> Floats:
        back = respond(pair, values, reading, adjoint=True)
        return sigma_difference**2 * values + sigma_theta**2 * respond(pair, back, reading)

    size = np.linalg.norm(columns, axis=0)
    scaled = columns / size
    matrix = LinearOperator((len(columns), len(columns)), matvec=covariance, dtype=np.float64)
    solved = np.stack([cg(matrix, column, rtol=_TOLERANCE, maxiter=_MOST_ROUNDS)[0] for column in scaled.T], axis=-1)
    information = scaled.T @ solved
    return float(np.sqrt(np.linalg.inv(0.5 * (information + information.T))[0, 0]) / size[0])


def gravity_bound(scene: Scene) -> float:
    """Least standard deviation of gravity from a scene's record without gaps, mGal.

    The scene has two pendulums whose first and whose difference are read with the same white noise at even times.
    """
    noise = scene.recording.noise
    step = float(scene.recording.step)
    every = max(1, round(FINEST * step))
    fine = scene.model_copy(update={"recording": Recording.model_validate({"sampling_rate": every / step})})
    known = simulate(fine)[1]["truth"].dataset
    theta = np.asarray(known["theta"].values)
    n1, n2 = (float(each) for each in known["frequency"].values)
    gamma1, gamma2 = (float(each) for each in known["damping_rate"].values)
    difference, time = theta[0] - theta[1], np.arange(int(4.0 * np.pi / n2 / (step / every))) * (step / every)
    # A - iB at t = 0, by least squares over two swings: the bound needs it to a per cent
    basis = np.stack([np.cos(n2 * time), np.sin(n2 * time)], axis=-1)
    a, b = np.linalg.lstsq(basis, difference[: time.size], rcond=None)[0]
    pair = Pair(n2, n1 / n2, gamma2, gamma1 - gamma2, complex(a, -b))
    known_damping = scene.recording.write_damping
    sigma = bound(pair, theta[0], step / every, noise, noise, every=every, damping_known=known_damping)
    return 2.0 * scene.gravity * sigma / n2 / MGAL
