"""A chronometer that loses shows periods too short."""

from __future__ import annotations

from pipeline.ledger.entry import DAY, Case, Change, absent

NAME = "chronometer"
FORMULA = "T_true = T (1 + r/86400), r in s a day, losing positive"
SOURCE = "definition of the rate; Vening Meinesz 1929, Theory and Practice of Pendulum Observations at Sea"
RATE = "chronometer_rate"
NEEDS: tuple[str, ...] = ()  # a rate of nought that is stated, too, is told from none
TIMES = "time_uncertainty"
USES = (RATE, f"{RATE}_uncertainty")


def change(case: Case, gravity: float) -> Change:
    """From the record's time to true time."""
    seen = case.prepared.observation
    rate = seen.chronometer_rate
    own, times = case.uncertainty(RATE), seen.constants.get(TIMES)
    sigma = case.sigma(
        rate=None if own is None else case.by_period * own / DAY,
        times=None if times is None else case.by_period * times,
    )
    if rate == 0.0 and RATE not in seen.constants:
        reason = absent(seen.constants, (RATE,))
        if not times:
            return Change(gravity, 0.0, reason, applied=False)
        return Change(gravity, sigma, f"{reason}; sigma is that of record/{TIMES}", applied=False)
    after = gravity / (1.0 + rate / DAY) ** 2
    return Change(after, sigma, f"rate {rate:+.3f} s/day")
