"""One step of the lattice: exact flow of the linear part with its process noise, nodes of the remainder.

State: angle and speed of each pendulum, then the ship's states. With kappa_i = n_i^2 at reference gravity, G gravity, U
and Z the ship's horizontal and vertical acceleration, these over *reference* gravity,

    theta_i'' = -2 gamma_i theta_i' - kappa_i [(G + Z) sin theta_i + U cos theta_i] + kicks

Linear pendulums: sin theta -> theta, cos theta -> 1, without Z.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.ship import Component, Ship

POINTS = 4
NODES = 0.5 + 0.5 * np.polynomial.legendre.leggauss(POINTS)[0]  # Gauss nodes of a step
POWERS = 15
HALVINGS = 6  # Van Loan's exponential is taken of a short step, then doubled: stable where the drift is stiff


class Flow(NamedTuple):
    """Matrices of one step; p pendulums, d states, 4 nodes."""

    step: float  # s
    sine: bool
    """Restoring law; False: linear. The covariance follows a sine's derivative as it turns with the swing: a gain
    without the arcs, by which the ship's motion acts on pendulums as by their periods, errs by 2 mGal."""
    gravity: float  # G of the linear part
    kappa: Floats
    damping: Floats
    quadratic: Floats
    dry: Floats
    """(p,) n^2 at reference gravity, s-2; viscous rate, s-1; factor of |theta'| theta', 1; of sign theta', s-2."""
    fade: float  # Speed below which knife-edge friction fades, rad s-1; 0: where a pendulum turns
    to_nodes: Floats  # (8 p + 8, d) each pendulum's angle at the four nodes, each speed, U, Z under the linear flow
    sources: Floats  # (p, 16, d) angle, speed, U and Z at each node that a pendulum's remainder depends on
    ahead: Floats  # (d, d) the state at the step's end
    ends: Floats  # (4 + 2 p, d) rows of U, Z, their derivatives, each pendulum's angle and speed
    ahead_to_ends: Floats  # (4 + 2 p, d) the same at the step's end
    noise: Floats  # (d, d) covariance of the process noise
    heave_noise: float  # White noise of a recorded heave over reference gravity times the root of its step, s1/2
    response: Floats
    """(p, 5, 4, 2) angle and speed at each node and the end to Lagrange polynomials of an acceleration at the nodes."""
    angles: Floats  # (p, e, d) of each angle, as read, near a node by powers of the time from it, under the linear flow
    horizontal: Floats
    vertical: Floats  # (e, d) the same of U and Z
    pull: Floats  # (4, 4) Lagrange polynomials of the nodes, integrated twice: factors of the time's powers 2 to 5
    driven: Floats  # (2, d) covariance with the process noise of Z and its derivative at the step's end
    heaves: bool  # Whether vertical motion that is not recorded acts: what drives it acts within the step too
    drives: int
    """Ways in which noise acts on the pendulums within a step: what drives that motion, noise of a recorded one."""


@lru_cache(maxsize=4)  # trials of breaks and outliers share it
def flow(
    step: float, components: tuple[Component, ...], kappa: tuple[float, ...], damping: tuple[float, ...],
    kick: tuple[float, ...], quadratic: tuple[float, ...], dry: tuple[float, ...], gravity: float, sine: bool,
    fade: float = 0.0, sway: float = 0.0, heave_noise: float = 0.0,
) -> Flow:  # fmt: skip
    """Matrices of a step, s, of at most 1.3 rad of the swing; as in `Flow`, and `kick`, (p,): intensities of the random
    kicks, rad s-1/2; `sway`: acceleration of the support over reference gravity by a pendulum a radian aside."""
    from scipy.linalg import expm

    count, ship = len(kappa), Ship.of(components)
    two, size = 2 * count, 2 * count + ship.drift.shape[0]
    drift, drive = np.zeros((size, size)), np.zeros((size, size))
    drift[two:, two:], drive[two:, two:] = ship.drift, ship.drive
    u_row, t_row, z_row, p_row = (
        np.append(np.zeros(two), row) for row in (ship.horizontal, ship.transverse, ship.vertical, ship.tilt)
    )
    for i in range(count):
        drift[2 * i, 2 * i + 1] = 1.0
        drift[2 * i + 1, 2 * i], drift[2 * i + 1, 2 * i + 1] = -kappa[i] * gravity, -2.0 * damping[i]
        drift[2 * i + 1] -= kappa[i] * (u_row + t_row * (i > 0))
        drift[2 * i + 1, :two:2] -= kappa[i] * sway
        drive[2 * i + 1, 2 * i + 1] = kappa[i] * kick[i] ** 2
    van_loan = np.zeros((2 * size, 2 * size))
    van_loan[:size, :size], van_loan[:size, size:], van_loan[size:, size:] = -drift, drive, drift.T
    short = expm(van_loan * (step / 2**HALVINGS))
    transition = short[size:, size:].T
    noise = transition @ short[:size, size:]
    for _ in range(HALVINGS):
        noise, transition = transition @ noise @ transition.T + noise, transition @ transition
    to_node, noise = expm(drift * (NODES * step)[:, None, None]), 0.5 * (noise + noise.T)
    angles, speeds = (to_node[:, k:two:2].transpose(1, 0, 2) for k in (0, 1))
    groups = np.concatenate([angles, speeds, [u_row @ to_node], [z_row @ to_node]])
    horizontal, vertical = _powers(drift, u_row), _powers(drift, z_row)
    ends = np.concatenate([horizontal[:2], vertical[:2], np.eye(size)[:two]])
    acting = [[i, count + i, two, two + 1] for i in range(count)]
    heaves = bool(sine and np.any(vertical))
    return Flow(
        step=step, sine=sine, gravity=gravity, kappa=np.array(kappa), damping=np.array(damping),
        quadratic=np.array(quadratic), dry=np.array(dry), fade=fade,
        to_nodes=groups.reshape(-1, size),
        sources=np.stack([groups[some].transpose(1, 0, 2).reshape(-1, size) for some in acting]),
        ahead=np.ascontiguousarray(transition), ends=ends, ahead_to_ends=ends @ transition,
        noise=noise, heave_noise=heave_noise,
        response=_response(step, gravity * np.array(kappa), damping),
        angles=np.stack([_powers(drift, row - p_row) for row in np.eye(size)[:two:2]]),
        horizontal=horizontal, vertical=vertical, pull=_PULL / step ** np.arange(POINTS),
        driven=vertical[:2] @ noise, heaves=heaves, drives=(2 if heaves else 0) + (POINTS if heave_noise > 0.0 else 0),
    )  # fmt: skip


_POLYNOMIALS = [np.poly1d(np.delete(NODES, m), r=True) for m in range(POINTS)]
_PULL = np.array([p.coeffs[::-1] / p(node) for p, node in zip(_POLYNOMIALS, NODES, strict=True)]) / [2, 6, 12, 20]


def _powers(drift: Floats, row: Floats) -> Floats:
    """Terms of the exponential series of a row, (e, d)."""
    out = [row]
    for power in range(1, POWERS):
        out.append(out[-1] @ drift / power)
    return np.array(out)


_POINTS, _WEIGHTS = (each * 0.5 for each in np.polynomial.legendre.leggauss(12))
_ENDS = np.append(NODES, 1.0)
_AT = _ENDS[:, None] * (0.5 + _POINTS)  # of the integrals to each node and to the end, in steps
_LAGRANGE = np.array([p(_AT) / p(node) for p, node in zip(_POLYNOMIALS, NODES, strict=True)])


def _response(step: float, stiffness: Floats, damping: tuple[float, ...]) -> Floats:
    """Integrals of each pendulum's response to the Lagrange polynomials through the nodes, (p, 5, 4, 2)."""
    since = (_ENDS[:, None] - _AT) * step
    out = np.zeros((stiffness.size, POINTS + 1, POINTS, 2))
    for i, (square, rate) in enumerate(zip(stiffness, damping, strict=True)):
        own = np.sqrt(square - rate**2)
        fading = _WEIGHTS * (_ENDS[:, None] * step) * np.exp(-rate * since)
        moved = fading * np.sin(own * since) / own
        out[i, ..., 0] = np.einsum("je,mje->jm", moved, _LAGRANGE)
        out[i, ..., 1] = np.einsum("je,mje->jm", fading * np.cos(own * since) - rate * moved, _LAGRANGE)
    return out
