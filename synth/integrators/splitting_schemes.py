"""Splittings for a motion that is nearly exactly solvable, of generalised order (8, 6, 4), (10, 6, 4) and Strang's.

For d/dt = A + eps B with A solved exactly and B a kick, the scheme `a_1 A, b_1 B, a_2 A, ..., a_1 A` errs by
O(eps h^8 + eps^2 h^6 + eps^3 h^4), or with h^10 in the first term.

Source of the numbers: Blanes, Casas, Farres, Laskar, Makazaga, Murua, Appl. Numer. Math. 68 (2013) 58-72. The tests check
the conditions of the first two terms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synth.phase import Floats


@dataclass(frozen=True)
class Scheme:
    """A symmetric splitting.

    Attributes
    ----------
    name : str
    nodes : (kicks,) array
        Time of each kick, as a share of the step.
    weights : (kicks,) array
        Size of each kick.
    orders : tuple
        Powers of the step in the errors of eps, eps^2, eps^3.
    """

    name: str
    nodes: Floats
    weights: Floats
    orders: tuple[int, int, int]


def _symmetric(name: str, drifts: list[float], kicks: list[float], stages: int, orders: tuple[int, int, int]) -> Scheme:
    """Unfold a scheme from its first half."""
    drift = drifts + drifts[: stages + 1 - len(drifts)][::-1]
    kick = kicks + kicks[: stages - len(kicks)][::-1]
    return Scheme(name, np.cumsum(drift[:-1]), np.array(kick), orders)


ABA864 = _symmetric(
    "ABA(8,6,4)",
    [0.07113342649822312, 0.2411534279566401, 0.5214117617728148, -0.33369861622767800573],
    [0.18308368747219722, 0.31078285989857487, -0.026564618511958801, 0.065396142282373418],
    stages=7,
    orders=(8, 6, 4),
)
ABA1064 = _symmetric(
    "ABA(10,6,4)",
    [0.038094497422412195, 0.14529871611691375, 0.20762769572554125, 0.43590970365152616, -0.65386122583278671],
    [0.095858880837075211, 0.20444615314299878, 0.21707034797899110, -0.017375381959065093],
    stages=8,
    orders=(10, 6, 4),
)
STRANG = _symmetric("Strang", [0.5], [1.0], stages=1, orders=(2, 2, 2))
SCHEMES = {scheme.name: scheme for scheme in (ABA864, ABA1064, STRANG)}
