"""Keeping the ledger: corrections in their order, each from where the one before it ends."""

from __future__ import annotations

from types import ModuleType

from pipeline.ledger import (
    air_density,
    base_tie,
    chronometer,
    eotvos,
    finite_arc,
    flexure,
    horizontal_acceleration,
    non_isochronism,
    planes,
    rocking,
    temperature,
    tide,
    tilt,
    transverse_acceleration,
    vertical_acceleration,
    yaw,
)
from pipeline.ledger.apparatus import CASE_TILT, CLOCK_STEPS, SCALE, ZERO, Part
from pipeline.ledger.entry import MGAL, Case, Change, Entry, absent

Correction = ModuleType | Part

OWN: tuple[Correction, ...] = (
    non_isochronism,
    ZERO,
    SCALE,
    CLOCK_STEPS,
    finite_arc,
    CASE_TILT,
    horizontal_acceleration,
    vertical_acceleration,
)
"""What a method corrects itself: parts of the one frequency that it gives."""

GIVEN: tuple[Correction, ...] = (
    transverse_acceleration,
    rocking,
    planes,
    chronometer,
    temperature,
    air_density,
    flexure,
    base_tie,
    yaw,
    tilt,
    eotvos,
    tide,
)
"""What the record states of clock, instrument, stand and way, in the order in which it is applied."""

CORRECTIONS: tuple[Correction, ...] = (*OWN, *GIVEN)


def own(case: Case) -> dict[str, Entry]:
    """What the method itself corrected, split into its parts."""
    return _balance(case, OWN, case.gravity_of(case.estimate.uncorrected))[1]


def given(case: Case) -> tuple[float, dict[str, Entry]]:
    """Apply every correction whose inputs the record states, and list the others: gravity (m s-2) and entries."""
    return _balance(case, GIVEN, case.gravity_of(case.estimate.frequency))


def _balance(case: Case, modules: tuple[Correction, ...], gravity: float) -> tuple[float, dict[str, Entry]]:
    constants = case.prepared.observation.constants
    ledger = {}
    for module in modules:
        missing = absent(constants, module.NEEDS)
        change: Change = Change(gravity, 0.0, missing, applied=False) if missing else module.change(case, gravity)
        ledger[module.NAME] = Entry(
            value=(change.gravity - gravity) / MGAL,
            sigma=change.sigma,
            applied=change.applied,
            reason=change.reason,
            inputs=inputs(case, module) if change.applied else (),
        )
        gravity = change.gravity
    return gravity, ledger


def inputs(case: Case, module: Correction) -> tuple[str, ...]:
    """Names of the record's variables that a correction was made from."""
    constants = case.prepared.observation.constants
    wanted = [*module.NEEDS, *(f"{name}_uncertainty" for name in module.NEEDS), *module.USES]
    return tuple(dict.fromkeys(f"instrument/{name}" for name in wanted if name in constants))
