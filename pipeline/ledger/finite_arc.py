"""Finite arcs: each pendulum swings slower than at an infinitesimal arc, and the fictitious one mixes both."""

from __future__ import annotations

from pipeline.ledger.entry import MGAL, Case, Change

NAME = "finite_arc"
FORMULA = "n_i -> n_i (1 - Theta_i^2/16); difference: -(n/16) Re[(|Z1|^2 Z1 - |Z2|^2 Z2)/Z]"
SOURCE = "series of the elliptic integral; Panteleev 1958, (36)-(38), fed with the pendulums' own speeds"
NEEDS: tuple[str, ...] = ()
USES: tuple[str, ...] = ()


def change(case: Case, gravity: float) -> Change:
    """Arc of the fictitious pendulum; the reason names what either pendulum alone would need."""
    shares = case.shares
    after = case.gravity_of(case.estimate.frequency - shares.horizontal - shares.vertical)
    if shares.arc == 0.0:
        linear = case.prepared.observation.restoring == "linear"
        why = "the record says restoring = linear" if linear else "the method takes the pendulums as linear"
        return Change(after, 0.0, why, applied=False)
    # dg/g = 2 dn/n
    one, two = (gravity * square / 8.0 / MGAL for square in shares.squares)
    seen = case.prepared.observation
    alone = f"pendulum {seen.first} alone {one:+.2f} mGal, pendulum {seen.second} {two:+.2f}"
    return Change(after, 0.0, f"the fictitious pendulum's; {alone}")
