"""Keeping the ledger: corrections in their order, each from where the one before it ends."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from types import MappingProxyType, ModuleType

import numpy as np

from data_schemas.errors import UsageError
from data_schemas.variables import add_constant
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
from pipeline.ledger.entry import ASSUMED, MGAL, Case, Change, Entry, absent

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

GIVEN: list[Correction] = [
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
]
"""What the record states of clock, instrument, stand and way, in the order in which it is applied."""
GROUP = "isochrony.corrections"
"""Of entry points."""


def corrections() -> tuple[Correction, ...]:
    """All of them, in the order in which they are applied; those of entry points last."""
    _load()
    return (*OWN, *GIVEN)


@functools.cache
def _load() -> None:
    from importlib.metadata import entry_points

    for point in entry_points(group=GROUP):
        register_correction(point.load())


def register_correction(
    correction: Correction, variables: Mapping[str, tuple[str, str]] = MappingProxyType({})
) -> None:
    """Add a correction to the ledger, behind those that are there.

    Parameters
    ----------
    correction : module or object
        With NAME, FORMULA, SOURCE, NEEDS, USES and `change`; see `pipeline.ledger`.
    variables : mapping
        Numbers of /instrument that it needs and the table has not: name to unit and meaning.

    Raises
    ------
    UsageError
        There is a correction of this name.
    """
    if any(each.NAME == correction.NAME for each in (*OWN, *GIVEN)):
        raise UsageError(f"correction '{correction.NAME}': is in the ledger already; give yours another name")
    for name, (units, long_name) in variables.items():
        add_constant(name, units, long_name)
    GIVEN.append(correction)


def own(case: Case) -> dict[str, Entry]:
    """What the method itself corrected, split into its parts."""
    return _balance(case, OWN, case.gravity_of(case.estimate.uncorrected))[1]


def given(case: Case) -> tuple[float, dict[str, Entry]]:
    """Apply every correction whose inputs the record states, and list the others: gravity (m s-2) and entries."""
    _load()
    return _balance(case, GIVEN, case.gravity_of(case.estimate.frequency))


def _balance(case: Case, modules: Sequence[Correction], gravity: float) -> tuple[float, dict[str, Entry]]:
    constants = case.prepared.observation.constants
    ledger = {}
    for module in modules:
        missing = absent(constants, module.NEEDS)
        change: Change = Change(gravity, 0.0, missing, applied=False) if missing else module.change(case, gravity)
        value, stated = (change.gravity - gravity) / MGAL, not np.isnan(change.sigma)
        ledger[module.NAME] = Entry(
            value=value,
            sigma=change.sigma if stated else ASSUMED * abs(value),
            applied=change.applied,
            reason=change.reason + ("" if stated else f"; no uncertainty stated, {100.0 * ASSUMED:g} % assumed"),
            inputs=inputs(case, module) if change.applied else (),
            stated=stated,
        )
        gravity = change.gravity
    return gravity, ledger


def inputs(case: Case, module: Correction) -> tuple[str, ...]:
    """Names of the record's variables that a correction was made from."""
    constants = case.prepared.observation.constants
    wanted = [*module.NEEDS, *(f"{name}_uncertainty" for name in module.NEEDS), *module.USES]
    return tuple(dict.fromkeys(f"instrument/{name}" for name in wanted if name in constants))
