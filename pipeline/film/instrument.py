"""The group /instrument of a film's record: constants, base ties and readings, as described and as the user says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.errors import UsageError
from data_schemas.film_description import BASE, BASES, COURSES, PENDULUM, PERIODS, FilmDescription
from data_schemas.variables import dataset
from pipeline.film.knowledge import Known
from pipeline.film.parts import Floats

if TYPE_CHECKING:
    import xarray as xr


def instrument_of(
    known: Known,
    pendulums: Sequence[Any],
    time: Floats,
    rate_uncertainty: float | None,
    scale_uncertainty: float | None,
    *,
    needed: bool,
) -> xr.Dataset | None:
    """Constants of the instrument; None where nothing is known of it nor needed.

    Parameters
    ----------
    known : Known
    pendulums : sequence of DescribedPendulum
        Those of the traces, in the record's order.
    time : (samples,) array
        s, of the record.
    rate_uncertainty : float or None
        By how much the film's time axis may run wrong, s a day. It is that of the times alone: the samples'
        uncertainty has no part in it, nor it in theirs, so that gravity counts each once.
    scale_uncertainty : float or None
        By how much, relative, all elongations may be wrong.
    needed : bool
        Whether gravity is to be had: periods and their gravity must be known.

    Raises
    ------
    UsageError
        They are not.
    """
    description, labels = known.description, [str(each.label) for each in pendulums]
    values: dict[str, Any] = {}
    names: dict[str, list[str]] = {PENDULUM: labels}
    if description is not None:
        values.update({key: value for key, value in description.instrument.model_dump().items() if value is not None})
        values.update(_readings(description, time))
    for key in type(pendulums[0]).model_fields:
        stated = [getattr(each, key) for each in pendulums]
        if key != "label" and None not in stated:
            values[key] = np.array(stated, dtype=np.float64)
    if known.options.gravity is not None:
        values["reference_gravity"] = known.options.gravity
    if needed:
        _check(pendulums, values)
    if description is not None and description.bases:
        values.update(_bases(description, labels))
        names[BASE] = [base.label for base in description.bases]
    if not values:
        return None
    if rate_uncertainty is not None:
        values.setdefault("chronometer_rate", 0.0)
        stated_uncertainty = values.get("chronometer_rate_uncertainty", 0.0)
        values["chronometer_rate_uncertainty"] = float(np.hypot(stated_uncertainty, rate_uncertainty))
    if scale_uncertainty is not None:
        values["scale_uncertainty"] = scale_uncertainty
    instrument = dataset("instrument", values, names)
    if description is not None and "restoring" in description.model_fields_set:
        instrument.attrs["restoring"] = description.restoring
    return instrument


def _check(pendulums: Sequence[Any], values: dict[str, Any]) -> None:
    for each in pendulums:
        if each.period is None:
            raise UsageError(
                f"pendulum {each.label} has no period, which gravity needs; add --period {each.label}=SECONDS, "
                "or say with --trace what the traces are"
            )
    if "reference_gravity" not in values:
        raise UsageError("the gravity at which the periods hold is missing; add --gravity, in m/s2")


def _bases(description: FilmDescription, labels: list[str]) -> dict[str, Floats]:
    """Variables of the occupations of base stations, of the pendulums that the film shows."""
    found = {}
    for name, key in BASES.items():
        stated = [getattr(base, key) for base in description.bases]
        if None not in stated:
            found[name] = np.array(stated, dtype=np.float64)
    for name, key in PERIODS.items():
        each = [getattr(base, key) for base in description.bases]
        if None not in each:
            found[name] = np.array([[periods[label] for label in labels] for periods in each], dtype=np.float64)
    return found


def _readings(description: FilmDescription, time: Floats) -> dict[str, Floats]:
    """Conditions at every sample: straight between readings, the first before them and the last after."""
    found = {}
    for name in COURSES:
        read = [(each.time, getattr(each, name)) for each in description.readings if getattr(each, name) is not None]
        if read:
            found[name] = np.interp(time, *np.array(read, dtype=np.float64).T)
    return found
