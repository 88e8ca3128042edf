"""What every method returns, and the error budget that all of them share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.arrays import Complexes, Floats
from pipeline.harmonics.envelope import Envelope, fill
from pipeline.harmonics.narrowband import NarrowbandFit, running_integral

COLOUR_SECONDS = 4.0  # length of the blocks in which a residual is compared with a swing


@dataclass(frozen=True)
class Budget:
    """Sensitivities of the frequency of the difference pendulum, all linear."""

    noise_difference: float  # 1 sigma of the frequency, rad s-1, per radian of white reading noise in the series
    noise_theta: float
    by_ratio: float  # d n2 / d (n1/n2), rad s-1
    by_gain: float  # d n2 / d ln(gain of the first pendulum's trace), rad s-1
    by_damping: float  # d n2 / d (gamma1 - gamma2)
    influence: Complexes  # (k,) g of `d n2 = Re sum conj(g) dD` over the envelope's instants, s-1


@dataclass(frozen=True)
class Estimate:
    """Frequency of the second pendulum, as one method has it.

    Attributes
    ----------
    frequency : float
        Circular frequency at infinitesimal arc, undamped, rad s-1, in the record's own time.
    uncorrected : float
        The same from the plain slope of the difference's phase, rad s-1.
    sigma : float
        1-sigma of `frequency` from reading noise, rad s-1.
    noise : float
        1-sigma residual of the difference, rad (equivalent white reading noise).
    damping_rate : float
        gamma2 used or found, s-1.
    samples : int
        Samples of the difference that were used.
    residual_colour : float
        Power of the residual near the pendulum's frequency over that of white noise of the same total (1 = white).
    shifts : mapping or None
        Phases that the method took off the difference's, (k,) rad at the envelope's instants, by `correction.PARTS`;
        None: it found the frequency in another way.
    finite_arc : float
        Part of the correction that is due to the finite arc, rad s-1.
    acceleration_reduced : bool
        Whether the support's acceleration was reduced as it acts on real pendulums.
    of_mean : bool
        Whether it is that of the mean of gravity over the record; else that of a phase's slope. The uncertainty of the
        periods then is in `sigma`.
    parts : mapping
        Entries of the ledger within the correction, by name: value and 1 sigma, mGal, and words.
    shares : mapping
        Of the square of `sigma`, by source; they add up to 1.
    """

    frequency: float
    uncorrected: float
    sigma: float
    noise: float
    damping_rate: float
    samples: int
    residual_colour: float = 1.0
    shifts: Mapping[str, Floats] | None = None
    finite_arc: float = 0.0
    acceleration_reduced: bool = False
    of_mean: bool = False
    parts: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)
    shares: Mapping[str, float] = field(default_factory=lambda: {"reading": 1.0})


def budget(envelope: Envelope, fit: NarrowbandFit, ratio: float, damping_difference: float) -> Budget:
    """Propagate noise, ratio and gain through the least-squares fit of the complex form.

    Noise of the first pendulum enters through the running integral, hence by the adjoint: the influence of one instant
    of it is the tail sum of the influences of all later instants of the difference.
    """
    weight = np.where(np.isfinite(envelope.difference), envelope.coverage, 0.0)
    # complex influence per instant: d n2 = Re sum conj(g_k) dD_k
    g: Complexes = weight * (fit.influence @ fit.jacobian)
    growth = fit.jacobian[0]
    kappa = 1j * fit.frequency * (ratio - 1.0) - damping_difference
    tail = np.cumsum((np.conj(g) * growth)[::-1]) / growth[::-1]
    # what the first pendulum's envelope does to the difference
    response = np.conj(g) @ (growth * running_integral(fill(envelope.first) / growth, envelope.hop))
    samples_theta, samples_difference = envelope.samples
    spread = np.abs(g[weight > 0.0]) ** 2 / weight[weight > 0.0]
    return Budget(
        noise_difference=float(np.sqrt(2.0 / samples_difference * np.sum(spread))),
        noise_theta=abs(kappa) * envelope.hop * float(np.sqrt(2.0 / samples_theta * np.sum(np.abs(tail) ** 2))),
        by_ratio=-float((1j * fit.frequency * response).real),
        by_gain=-float((kappa * response).real),
        by_damping=float(response.real),
        influence=g,
    )
