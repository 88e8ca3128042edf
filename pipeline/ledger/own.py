"""What a method corrects itself, in parts: unequal periods, arcs, accelerations, faults of the apparatus."""

import numpy as np

from pipeline.conditions import MGAL
from pipeline.ledger.entry import Case, Change, Correction, correction

BROWNE = "Browne 1937, Mon. Not. R. astr. Soc. Geophys. Suppl. 4, 271"


def uncertainty(case: Case) -> float:
    """From n1/n2 by the first period (the second's is the base tie's), and from the first trace's gain, mGal."""
    period = float(case.prepared.observation.period_relative_uncertainty[0])
    return float(np.hypot(0.0 if case.estimate.of_mean else case.by_ratio * period, case.by_gain_uncertainty))


@correction(
    "non_isochronism",
    "phi' = n2 + (n1-n2) (Theta1/a) cos(Phi1-phi) - (gamma1-gamma2) (Theta1/a) sin(Phi1-phi)",
    "Panteleev 1958, (27), damping added; exact methods: what their fit changes beyond the entries below",
    uses=("period", "damping_rate"),
)
def non_isochronism(case: Case, gravity: float) -> Change:
    """All of the method's own correction that is neither arc nor acceleration: what the unequal periods do."""
    estimate, shares = case.estimate, case.shares
    unbent = estimate.frequency - shares.arc - shares.horizontal - shares.vertical
    others = sum(value for name, (value, _, _) in estimate.parts.items() if name != CASE_TILT.NAME)
    after = case.gravity_of(unbent) - others * MGAL
    if unbent == estimate.uncorrected:
        return Change(after, uncertainty(case), "the method corrects nothing", applied=False)
    known = "stated" if case.prepared.observation.damping_rate is not None else "taken as zero, none is stated"
    return Change(after, uncertainty(case), f"n1/n2 from instrument/period; damping difference {known}")


@correction(
    "finite_arc",
    "n_i -> n_i (1 - Theta_i^2/16); difference: -(n/16) Re[(|Z1|^2 Z1 - |Z2|^2 Z2)/Z]",
    "series of the elliptic integral; Panteleev 1958, (36)-(38), fed with the pendulums' own speeds",
)
def finite_arc(case: Case, gravity: float) -> Change:
    """Arc of the fictitious pendulum; the reason names what either pendulum alone would need."""
    shares = case.shares
    after = case.gravity_of(case.estimate.frequency - shares.horizontal - shares.vertical)
    if shares.arc == 0.0:
        linear = case.prepared.observation.restoring == "linear"
        why = "the record says restoring = linear" if linear else "the method takes the pendulums as linear"
        return Change(after, 0.0, why, applied=False)
    # dg/g = 2 dn/n
    alone = case.alone(*(gravity * square / 8.0 / MGAL for square in shares.squares))
    return Change(after, 0.0, f"the fictitious pendulum's; {alone}")


@correction(
    "horizontal_acceleration",
    "-<x''^2>/(2g) in the slow limit; n sqrt(Gamma) with Gamma = 1/cos psi + tan psi psi''/n^2",
    BROWNE,
)
def horizontal_acceleration(case: Case, gravity: float) -> Change:
    """From the slow motion of the first pendulum, which shows the support's acceleration itself."""
    after = case.gravity_of(case.estimate.frequency - case.shares.vertical)
    if case.shares.reduced:
        return Change(after, 0.0, "slow motion of the first pendulum")
    size = -0.5 * gravity * case.prepared.slow_square / MGAL  # x'' = -g psi
    real = "" if case.prepared.observation.restoring == "linear" else f"; real ones would need about {size:+.2f} mGal"
    return Change(after, 0.0, _why_not(case) + real, applied=False)


@correction(
    "vertical_acceleration",
    "<z''^2>/(4g) / (1 - m^2/4n^2), m the circular frequency of the heave",
    f"{BROWNE}; fast heave: Milne's equation to second order",
)
def vertical_acceleration(case: Case, gravity: float) -> Change:
    """From the recorded heave, which modulates gravity: the swing's mean frequency falls."""
    after = case.gravity_of(case.estimate.frequency)
    if not case.shares.reduced:
        return Change(after, 0.0, _why_not(case), applied=False)
    if case.prepared.observation.vertical is not None:
        return Change(after, 0.0, "record/vertical_acceleration")
    return Change(after, 0.0, "no record/vertical_acceleration in the record", applied=False)


def _why_not(case: Case) -> str:
    """Why a method leaves accelerations alone."""
    if case.prepared.observation.restoring == "linear":
        return "the record says restoring = linear: linear pendulums do not feel it"
    return "the method takes the pendulums as linear"


def _part(name: str, formula: str, source: str) -> Correction:
    """What the joint fit inferred of the apparatus: what gravity would lack if it were taken as perfect."""

    @correction(name, formula, source)
    def change(case: Case, gravity: float) -> Change:
        part = case.estimate.parts.get(name)
        if part is None:
            return Change(gravity, 0.0, "none was found, or the method takes it as exact", applied=False)
        value, sigma, words = part
        return Change(gravity + value * MGAL, sigma, words)

    return change


CONDITION = "condition on the constants being zero, of the joint fit's posterior"
ZERO = _part("zero", "g b^2/2 in the slow limit, b the zero, drift or step of the first pendulum's trace", CONDITION)
SCALE = _part("scale", "about 2 times the relative error times arc and acceleration terms", CONDITION)
CLOCK_STEPS = _part("clock_steps", "2 g dt/T times the share of the record behind them", CONDITION)
CASE_TILT = _part(
    "case_tilt", "-g (2 <psi p> - <p^2>)/2, p the tilt that is added to what was read", "Browne's term, split"
)
