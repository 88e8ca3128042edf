"""A chronometer that loses shows periods too short."""

from __future__ import annotations

from pipeline.ledger.entry import DAY, Case, Change, absent

NAME = "chronometer"
FORMULA = "T_true = T (1 + r/86400), r in s a day, losing positive"
SOURCE = "definition of the rate; Vening Meinesz 1929, Theory and Practice of Pendulum Observations at Sea"
RATE = "chronometer_rate"
NEEDS: tuple[str, ...] = ()  # a rate of nought that is stated, too, is told from none
USES = (RATE, f"{RATE}_uncertainty")


def change(case: Case, gravity: float) -> Change:
    """From the record's time to true time."""
    seen = case.prepared.observation
    rate = seen.chronometer_rate
    if rate == 0.0 and RATE not in seen.constants:
        return Change(gravity, 0.0, absent(seen.constants, (RATE,)), applied=False)
    after = gravity / (1.0 + rate / DAY) ** 2
    own = case.uncertainty(RATE)
    sigma = case.sigma(rate=None if own is None else case.by_period * own / DAY)
    return Change(after, sigma, f"rate {rate:+.3f} s/day")
