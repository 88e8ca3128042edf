"""Keeping the ledger: corrections in their order, each from where the one before it ends."""

import functools
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from data_schemas.errors import UsageError
from data_schemas.variables import add_constant
from pipeline.conditions import MGAL
from pipeline.ledger import earth, instrument, own
from pipeline.ledger.entry import ASSUMED, Case, Change, Correction, Entry, absent

OWN: tuple[Correction, ...] = (
    own.non_isochronism, own.ZERO, own.SCALE, own.CLOCK_STEPS, own.finite_arc, own.CASE_TILT,
    own.horizontal_acceleration, own.vertical_acceleration,
)  # fmt: skip
"""What a method corrects itself: parts of the one frequency that it gives."""
GIVEN: list[Correction] = [
    instrument.transverse_acceleration, instrument.rocking, instrument.planes, instrument.chronometer,
    instrument.temperature, instrument.air_density, instrument.flexure, instrument.base_tie, instrument.yaw,
    instrument.tilt, earth.way, earth.moon_and_sun,
]  # fmt: skip
"""What the record states of clock, instrument, stand and way, in the order in which it is applied."""
GROUP = "isochrony.corrections"  # Of entry points


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
    correction : object
        With NAME, FORMULA, SOURCE, NEEDS, USES and `change`, as `pipeline.ledger.entry.Correction`.
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


def own_entries(case: Case) -> dict[str, Entry]:
    """What the method itself corrected, split into its parts."""
    return _balance(case, OWN, case.gravity_of(case.estimate.uncorrected))[1]


def given(case: Case) -> tuple[float, dict[str, Entry]]:
    """Apply every correction whose inputs the record states, and list the others: gravity (m s-2) and entries."""
    _load()
    return _balance(case, GIVEN, case.gravity_of(case.estimate.frequency))


def _balance(case: Case, corrections: Sequence[Correction], gravity: float) -> tuple[float, dict[str, Entry]]:
    constants = case.prepared.observation.constants
    ledger = {}
    for each in corrections:
        missing = absent(constants, each.NEEDS)
        change: Change = Change(gravity, 0.0, missing, applied=False) if missing else each.change(case, gravity)
        value, stated = (change.gravity - gravity) / MGAL, not np.isnan(change.sigma)
        wanted = dict.fromkeys((*each.NEEDS, *(f"{name}_uncertainty" for name in each.NEEDS), *each.USES))
        ledger[each.NAME] = Entry(
            value=value,
            sigma=change.sigma if stated else ASSUMED * abs(value),
            applied=change.applied,
            reason=change.reason + ("" if stated else f"; no uncertainty stated, {100.0 * ASSUMED:g} % assumed"),
            inputs=" ".join(f"instrument/{name}" for name in wanted if name in constants) if change.applied else "",
            stated=stated,
        )
        gravity = change.gravity
    return gravity, ledger
