"""What the joint fit found of the apparatus: each entry is what gravity would lack if it were taken as perfect."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.ledger.entry import MGAL, Case, Change


@dataclass
class Part:
    """An entry of the ledger that a method reduces itself; see `pipeline.ledger`."""

    NAME: str
    FORMULA: str
    SOURCE: str = "condition on the constants being zero, of the joint fit's posterior"
    NEEDS: tuple[str, ...] = ()
    USES: tuple[str, ...] = ()

    def change(self, case: Case, gravity: float) -> Change:
        """Add what the estimate says."""
        part = case.estimate.parts.get(self.NAME)
        if part is None:
            return Change(gravity, 0.0, "none was found, or the method takes it as exact", applied=False)
        value, sigma, words = part
        return Change(gravity + value * MGAL, sigma, words)


ZERO = Part("zero", "g b^2/2 in the slow limit, b the zero, drift or step of the first pendulum's trace")
SCALE = Part("scale", "about 2 times the relative error times arc and acceleration terms")
CLOCK_STEPS = Part("clock_steps", "2 g dt/T times the share of the record behind them")
CASE_TILT = Part(
    "case_tilt", "-g (2 <psi p> - <p^2>)/2, p the tilt that is added to what was read", "Browne's term, split"
)
