"""A plane of swing that turns with the ship: the centrifugal force spreads the swing."""

from __future__ import annotations

from pipeline.ledger.entry import DAY, MGAL, Case, Change

NAME = "yaw"
FORMULA = "g W^2/n^2, W the rate of turn of the plane, held by the case"
SOURCE = "pendulum in a turning plane: theta'' + (n^2 - W^2 cos theta) sin theta = 0"
NEEDS = ("yaw_rate",)
USES: tuple[str, ...] = ()


def change(case: Case, gravity: float) -> Change:
    """Add the centrifugal part."""
    rate = case.scalar("yaw_rate")
    true = case.estimate.frequency / (1.0 + case.prepared.observation.chronometer_rate / DAY)
    after = gravity * (1.0 + rate**2 / true**2)
    own = case.uncertainty(NEEDS[0])
    sigma = case.sigma(rate=None if own is None else 2.0 * gravity * rate * own / true**2 / MGAL)
    return Change(after, sigma, f"{rate:+.5f} rad/s")
