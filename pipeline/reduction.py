"""One method on one prepared record: gravity with its uncertainty, ledger, sensitivities and flags, or a refusal."""

import time
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from xarray import DataTree

from data_schemas.errors import RefusedError
from pipeline.conditions import MGAL
from pipeline.correction import NON_ISOCHRONISM
from pipeline.flag_words import BLOCKING, FLAGS, OF_GRAVITY, told
from pipeline.harmonics.envelope import fill
from pipeline.ledger import book, own
from pipeline.ledger.entry import Case, Entry, arc_answer
from pipeline.methods import method
from pipeline.methods.phases import passes_zero
from pipeline.prepared import CAPTURE, COLOUR_SECONDS, Estimate, Prepared

SOURCES = {"chronometer": "clock", "base_tie": "ratio"}  # Of the ledger's entries that bear another name in the budget
HALVED = 0.75  # of the variance, which must go
COLOUR = 1.6  # power near the pendulum's frequency over white
COLOUR_FLOOR = 3e-4  # of the amplitude: a residual below it is the method's, not the readings'
SPARSE = 2.0 * np.pi / 8.0  # rad of the swing between readings, from which the residual does not show it
LEFT_OUT = "terms that the method leaves out"
SHORT_SECONDS = 300.0  # below it the near-resonant beat and the damping are not told from the frequency
NOISE_ABOVE, NOISE_BELOW = 1.3, 0.7  # found over stated
LEAST_BROWNE = 0.05  # mGal of horizontal acceleration
IMPLAUSIBLE = (9.75, 9.85)  # m s-2; at sea gravity lies between 9.77 and 9.84

DAMPING_ASSUMED = "damping-difference-assumed"
_DECAY = 3e-6  # s-1: one per cent of it as a difference costs about 0.01 mGal at a relative period difference of 1e-4
DAMPING_DOUBT = 0.3  # 1 sigma of a difference of damping that is not stated, over the damping


@dataclass(frozen=True)
class Gravity:
    """Gravity of one method."""

    gravity: float  # m s-2
    sigma: float  # 1 sigma, mGal: reading noise and the uncertainties of the ledger's entries, independent
    noise: float  # 1 sigma from the readings alone, mGal
    frequency: tuple[float, float]  # n1, n2 after all corrections, rad s-1: `gravity = g_ref (n2/n2_ref)^2`
    per_ratio: float  # change of gravity, mGal, for n1/n2 larger by 1e-7
    left_out: float  # 1 sigma, mGal, of what acts on the pendulums and the method leaves as it is
    given: dict[str, Entry] = field(repr=False)  # entries of the ledger that the record states
    _case: Case = field(repr=False)

    @cached_property
    def ledger(self) -> dict[str, Entry]:
        """Name to `Entry`; the values add up to gravity less the uncorrected gravity."""
        return book.own_entries(self._case) | self.given

    @cached_property
    def budget(self) -> dict[str, float]:
        """Shares of the variance by source, the largest first: of the method's own, and of the ledger's entries."""
        found = {name: share * self.noise**2 for name, share in self._case.estimate.shares.items()}
        parts = (("scale", self._case.by_gain_uncertainty), (LEFT_OUT, self.left_out))
        for name, sigma in (*parts, *((name, entry.sigma) for name, entry in self.given.items())):
            if sigma > 0.0:
                source = SOURCES.get(name, name)
                found[source] = found.get(source, 0.0) + sigma**2
        total = sum(found.values())
        shares = sorted(found.items(), key=lambda each: -each[1])
        return {name: value / total for name, value in shares} if total > 0.0 else {}

    @property
    def advice(self) -> str:
        """What to improve, and how far, to halve sigma."""
        needed, together = [], 0.0
        for name, share in self.budget.items():
            needed.append(name)
            together += share
            if together > HALVED:
                if LEFT_OUT in needed:
                    return "to halve sigma, take joint"
                factor = np.sqrt(together / (together - HALVED))
                return f"to halve sigma, make the uncertainty of {' and '.join(needed)} {factor:.2g} times smaller"
        return ""

    @property
    def uncorrected(self) -> float:
        """Gravity of the uncorrected frequency, m s-2."""
        return self._case.gravity_of(self._case.estimate.uncorrected)

    @property
    def per_gain(self) -> float:
        """Change of gravity, mGal, for a gain of the first pendulum's trace larger by 1 %."""
        return self._case.by_gain * 1e-2


def gravity(estimate: Estimate, prepared: Prepared, gain_uncertainty: float = 0.0) -> Gravity:
    """`g = g_ref (n/n_ref)^2` of the second pendulum after every correction, with all that is known of its error.

    `gain_uncertainty` is the relative 1 sigma of the first pendulum's scale against the difference's.
    """
    seen = prepared.observation
    plain = seen.reference_gravity * (estimate.frequency / prepared.nominal) ** 2
    scale = 2.0 * plain / estimate.frequency / MGAL  # mGal per rad s-1
    by_ratio = scale * prepared.fine_budget.by_ratio
    case = Case(estimate, prepared, gain_uncertainty, scale, by_ratio * seen.frequency_ratio, 2.0 * plain / MGAL)
    value, given = book.given(case)
    noise, left = scale * estimate.sigma, left_out(case)
    parts = [noise, left, own.uncertainty(case), *(entry.sigma for entry in given.values())]
    n2 = prepared.nominal * float(np.sqrt(value / seen.reference_gravity))
    return Gravity(
        gravity=value,
        sigma=float(np.sqrt(np.nansum(np.square(parts)))),
        noise=noise,
        frequency=(n2 * float(seen.frequency_reference[0] / seen.frequency_reference[1]), n2),
        per_ratio=by_ratio * 1e-7,
        left_out=left,
        given=given,
        _case=case,
    )


def left_out(case: Case) -> float:
    """Size of what acts on the pendulums and the method leaves as it is, mGal.

    Non-isochronism where it takes nothing off; arcs and accelerations of real pendulums (Browne's terms) where it takes
    them as linear. Where no law is stated the residual tells whether they are, if there are readings enough.
    """
    estimate, prepared = case.estimate, case.prepared
    seen, parts = prepared.observation, [0.0]
    if estimate.shifts is not None and NON_ISOCHRONISM not in estimate.shifts:
        parts.append(case.scale * (prepared.fine.frequency - estimate.frequency))
    shown = structured(prepared, estimate) or seen.step * prepared.nominal > SPARSE
    real = seen.restoring == "sine" or (seen.restoring != "linear" and shown)
    if real and not estimate.acceleration_reduced:
        parts.append(0.5 * seen.reference_gravity * prepared.slow_square / MGAL)
        if seen.vertical is not None:
            parts.append(0.25 * float(np.nanmean(seen.vertical**2)) / seen.reference_gravity / MGAL)
        if not estimate.finite_arc:
            swings = fill(prepared.sliding.first), fill(prepared.sliding.difference)
            parts.append(case.scale * arc_answer(prepared, *swings, estimate.frequency))
    return float(np.linalg.norm(parts))


def structured(prepared: Prepared, estimate: Estimate) -> bool:
    """Whether the residual has structure near the pendulum's frequency that the readings' noise does not have."""
    rises = estimate.residual_colour > COLOUR + 5.0 / np.sqrt(prepared.observation.time[-1] / COLOUR_SECONDS)
    amplitude = float(np.nanmedian(np.abs(prepared.sliding.difference)))
    return bool(rises and estimate.noise * np.sqrt(max(estimate.residual_colour, 1.0)) > COLOUR_FLOOR * amplitude)


@dataclass(frozen=True)
class Reduction:
    """Outcome of one method; `estimate` and `gravity` are None when it refused."""

    requested: str
    method: str
    reason: str = ""
    estimate: Estimate | None = None
    gravity: Gravity | None = None
    flags: tuple[str, ...] = ()
    error: str = ""
    elapsed: float = 0.0


def refused(name: str, refusal: RefusedError, started: float) -> Reduction:
    """Outcome of a method that refused, begun at a time of `perf_counter`."""
    return Reduction(name, name, error=str(refusal), elapsed=time.perf_counter() - started)


def reduce_by(name: str, prepared: Prepared, gain_uncertainty: float) -> Reduction:
    """Run a method and complete it with gravity and flags."""
    started = time.perf_counter()
    try:
        estimate = method(name)(prepared)
        if prepared.known_damping is None:
            doubt = DAMPING_DOUBT * estimate.damping_rate * prepared.fine_budget.by_damping
            estimate = replace(estimate, sigma=float(np.hypot(estimate.sigma, doubt)))
        departure = estimate.frequency / prepared.nominal - 1.0
        if not np.isfinite(departure) or abs(departure) > CAPTURE:
            raise RefusedError(
                f"instrument/period: the swing found departs by {100 * departure:.1f} % from the stated period; "
                "check the period and the time axis"
            )
    except RefusedError as refusal:
        return refused(name, refusal, started)
    value = gravity(estimate, prepared, gain_uncertainty)
    raised = tuple(flags(prepared, estimate, value))
    return Reduction(name, name, "", estimate, value, raised, elapsed=time.perf_counter() - started)


def of_film(record: DataTree, accept: Collection[str]) -> tuple[str, ...]:
    """What the film's reading left doubtful, as /film says; `RefusedError`: a flag blocks, and is not accepted."""
    if "film" not in record.children:
        return ()
    found = tuple(name for name in str(record["film"].attrs.get("flags", "")).split(", ") if name in FLAGS)
    for name in found:
        if name in BLOCKING and name not in accept:
            raise RefusedError(f"film: {name}: {told(name)}; --accept {name} reduces the record all the same")
    return found


def flags(prepared: Prepared, estimate: Estimate, value: Gravity) -> list[str]:
    """Flags of one method on one record, in the order of `flag_words.OF_GRAVITY`."""
    seen, envelope = prepared.observation, prepared.sliding
    beyond = np.array([0.0, seen.time[-1]]) - envelope.time[[0, -1]]  # half a window at either end
    ends = envelope.difference[[0, -1]] + beyond * envelope.difference_speed[[0, -1]]
    amplitude = np.abs(np.append(envelope.difference, ends))
    by_periods = abs(value.per_ratio) / 1e-7 * float(np.hypot(*seen.period_relative_uncertainty))
    stated, allowance = seen.sigma_difference, 5.0 / np.sqrt(2.0 * estimate.samples)  # of the estimate itself
    found = estimate.noise if stated is None else estimate.noise / stated
    least_decay = max(_DECAY, 5.0 * estimate.sigma)  # frequency and damping rate have the same standard deviation
    raised = {
        "beats-through-zero": passes_zero(amplitude),
        "short-record": float(seen.time[-1]) < SHORT_SECONDS,
        "frequency-difference-unresolved": by_periods > value.noise,
        "gravity-implausible": not IMPLAUSIBLE[0] < value.gravity < IMPLAUSIBLE[1],
        DAMPING_ASSUMED: seen.damping_rate is None and estimate.damping_rate > least_decay,
        "acceleration-not-reduced": _accelerated(prepared, estimate, value),
        "correction-without-uncertainty": any(
            entry.applied and not entry.stated and abs(entry.value) > value.noise for entry in value.given.values()
        ),
        "noise-above-stated": stated is not None and found > NOISE_ABOVE + allowance,
        "noise-below-stated": stated is not None and found < NOISE_BELOW - allowance,
        "residual-not-white": structured(prepared, estimate),
    }
    return [name for name in OF_GRAVITY if raised.get(name)]


def _accelerated(prepared: Prepared, estimate: Estimate, value: Gravity) -> bool:
    """Browne's `<x''^2>/(2 g)` with x'' = -g psi, against sigma; only where the pendulums are taken for real ones."""
    if estimate.acceleration_reduced:
        return False
    if prepared.observation.restoring != "sine" and estimate.finite_arc == 0.0:
        return False
    size = 0.5 * value.gravity * prepared.slow_square / MGAL
    return size > max(value.noise, LEAST_BROWNE)
