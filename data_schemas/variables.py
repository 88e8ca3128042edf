"""The one table of every variable a file may hold: dimensions, number type, unit, meaning and allowed range.

A key is ``group/name`` (``record/elongation``); a variable of the root has its bare name (``time``). The rows
of records and truths live in files of their own (`variables_record`, `variables_truth`); a new variable is one row.
Those of a summary stand at the root of its file and under ``summary/`` here.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from . import variables_record, variables_truth

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Variable:
    """What a variable must be."""

    dims: tuple[str, ...]  # in order; () for a scalar
    dtype: str  # number type in memory and on disk; "str" is variable-length UTF-8
    units: str  # as attached to the variable; "1" for counts, labels and ratios
    long_name: str
    standard_name: str | None = None  # only where the CF table has a name that means exactly this
    required: bool = False  # whether its group is incomplete without it
    attrs: Mapping[str, Any] = field(default_factory=dict)  # further ones: calendar, flag_masks and the like
    also: tuple[tuple[str, ...], ...] = ()  # other dimensions that are accepted
    limit: Literal["positive", "not negative"] | None = None  # what physics allows
    missing: bool = False  # whether NaN (a missing value) is allowed; infinite values never are


_ROW = re.compile(r"(\w+)\((.*?)\) (.*?)(?: \[(.*?)\])?: (.*)")
_RULES: dict[str, dict[str, Any]] = {
    "required": {"required": True},
    "missing": {"missing": True},
    "positive": {"limit": "positive"},
    "nonnegative": {"limit": "not negative"},
}
_MASKS = np.array(list(variables_record.ELONGATION_FLAGS.values()), dtype=np.uint16)  # CF 3.5: of its type
_TYPES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "text": ("str", "1", {}),
    "u1": ("u1", "1", {}),
    "flags": ("u2", "1", {"flag_masks": _MASKS, "flag_meanings": variables_record.FLAGS}),
    "epoch": ("f8", "seconds since 2000-01-01T00:00:00Z", {"calendar": "standard"}),
}  # Words in place of a unit: number type, unit, further attributes


def _rows(text: str) -> dict[str, dict[str, Variable]]:
    """Rows by group and name, of lines ``name(dimensions | others) unit [rules]: meaning`` below lines ``[group]``.

    In place of a unit "text", "u1" (a code), "flags" or "epoch". Rules, with commas: "required", "missing",
    "positive", "nonnegative", and "cf NAME", its standard name.
    """
    groups: dict[str, dict[str, Variable]] = {}
    group = ""
    for line in text.split("\n"):
        if line.startswith("["):
            group = line.strip("[]")
        elif line:
            found = _ROW.fullmatch(line)
            if found is None:
                raise ValueError(f"{line!r} is no row of a table of variables")
            name, places, unit, given, meaning = found.groups("")
            dims, *also = (tuple(re.findall(r"\w+", place)) for place in places.split("|"))
            dtype, units, attrs = _TYPES.get(unit, ("f8", unit, {}))
            rules: dict[str, Any] = {}
            for rule in filter(None, given.split(", ")):
                rules |= {"standard_name": rule[3:]} if rule.startswith("cf ") else _RULES[rule]
            row = Variable(dims, dtype, units, meaning, attrs=attrs, also=tuple(also), **rules)
            groups.setdefault(group, {})[name] = row
    return groups


def _uncertainty(row: Variable) -> Variable:
    """Standard deviation of a constant; one a variable of time has a single one."""
    units, also = row.units.partition("_")[0], tuple(dims for dims in row.also if dims != ("time",))
    meaning = f"standard deviation of the {row.long_name}"
    return replace(row, units=units, also=also, long_name=meaning, limit="not negative", standard_name=None)


_RESULT = """
[phases]
component(component) text [required]: pendulum, or difference of two pendulums
amplitude(component, time) rad [required, missing]: amplitude of the near-resonant harmonic
amplitude_sigma(component) rad [nonnegative, missing]: standard deviation of the amplitude from the readings of a window
phase(component, time) rad [required, missing]: phase of the near-resonant harmonic, unwrapped
phase_sigma(component, time) rad [nonnegative, missing]: standard deviation of the phase from the readings of a window
phase_speed(component, time) rad s-1 [missing]: time derivative of the phase, central differences
slow(component, time) rad [missing]: slow forced part of the elongation
phase_qc(component, time) flags: quality flags of the phase
fictitious_amplitude(time) rad [missing]: amplitude of the fictitious pendulum theta1 - (n1/n2) theta2, slow motion \
and all
fictitious_phase(time) rad [missing]: phase of the fictitious pendulum, unwrapped
formula(formula) text: formula of Panteleev (1958)
phase_speed_by_formula(formula, time) rad s-1 [missing]: phase speed of the difference, in (9) of the fictitious \
pendulum, that the formula gives
amplitude_rate(time) rad s-1 [missing]: time derivative of the difference's amplitude
amplitude_rate_by_27(time) rad s-1 [missing]: time derivative of the difference's amplitude that (26) and (27) give

[correction]
estimator(estimator) text [required]: name of the method
non_isochronism(estimator, time) rad s-1 [missing]: what unequal periods and damping add, corrected
arc(estimator, time) rad s-1 [missing]: what finite arcs take off, corrected
acceleration(estimator, time) rad s-1 [missing]: what acceleration of the support does, corrected
phase_speed_correction(estimator, time) rad s-1 [missing]: correction of the phase speed, added: the sum of its parts
phase_correction(estimator, time) rad [missing]: correction of the phase, added
corrected_phase_speed(estimator, time) rad s-1 [missing]: phase speed of the difference, corrected
corrected_gravity(estimator, time) m s-2 [missing]: gravity that the corrected phase speed stands for

[gravity]
estimator(estimator) text [required]: name of the method
gravity(estimator) m s-2 [required, positive, missing]: gravity after all corrections of the method
gravity_sigma(estimator) mGal [required, nonnegative, missing]: standard deviation of gravity
epoch(estimator) epoch: time that gravity holds for
pendulum(pendulum) text: label of the pendulum
frequency(estimator, pendulum) rad s-1 [positive, missing]: circular frequency at infinitesimal arc
frequency_sigma(estimator, pendulum) rad s-1 [nonnegative, missing]: standard deviation of the circular frequency
entry(entry) text: name of the correction
value(estimator, entry) mGal [missing]: correction of gravity, added
sigma(estimator, entry) mGal [nonnegative, missing]: standard deviation of the correction; 1 % of it where no input \
states one
value_period(estimator, entry) 1e-7 s [missing]: correction of the full period of the second pendulum, added
applied(estimator, entry) u1: 1 where the correction is in the gravity of the method
reason(estimator, entry) text: why the correction was applied or not
input(estimator, entry) text: variables of the record that the correction was made from
formula(entry) text: formula of the correction
formula_source(entry) text: where the formula comes from
noise_sigma(estimator) mGal [nonnegative, missing]: standard deviation of gravity from the readings alone
source(source) text: what makes gravity uncertain
share(estimator, source) 1 [nonnegative, missing]: share of the variance of gravity that a source brings
advice(estimator) text: what to improve to halve the standard deviation
uncorrected(estimator) m s-2 [missing]: gravity before any correction
normal_gravity() m s-2: normal gravity of GRS80 at the latitude, at the height or, below the sea, at its surface
free_air_anomaly(estimator) mGal [missing]: free-air anomaly
bouguer_anomaly(estimator) mGal [missing]: simple Bouguer anomaly, the sea as rock
flag(flag) text: what the reader of the result must know, one flag an entry
flag_meaning(flag) text: what the flag says

[course]
gravity_course(time) m s-2 [required, positive]: gravity along the track, all corrections applied; its mean is that \
of method joint
gravity_course_sigma(time) mGal [required, nonnegative]: standard deviation of gravity along the track

[ship]
horizontal_acceleration(time) m s-2 [missing]: horizontal acceleration of the support, as estimated
vertical_acceleration(time) m s-2 [missing]: vertical acceleration of the support, as estimated

[difference]
record_time(record_time) epoch [required]: time of the sample, from the start of the record
elongation(record_time) rad [missing]: elongation of the difference, as read
model(record_time) rad [missing]: elongation of the difference, as fitted
residual(record_time) rad [missing]: elongation less what was fitted

[spectrum]
frequency(frequency) s-1 [required, nonnegative]: frequency
residual_spectrum(frequency) rad2 s [nonnegative]: power spectral density of the residual, one-sided

[pendulums]
pendulum(pendulum) text [required]: label of the pendulum
record_time(record_time) epoch [required]: time of the sample, from the start of the record
theta(pendulum, record_time) rad [missing]: angle of the pendulum from the vertical, as fitted

[period]
period() s [required, positive, missing]: full period at infinitesimal arc
period_sigma() s [required, nonnegative, missing]: standard deviation of the full period
cycle_time(cycle) s [missing]: middle of the cycle, from the start of the record
amplitude(cycle) rad [nonnegative, missing]: amplitude of the cycle
cycle_period(cycle) s [positive, missing]: full period of the cycle
cycle_period_smoothed(cycle) s [positive, missing]: full period of the cycle, smoothed
cycle_period_infinitesimal(cycle) s [positive, missing]: full period of the cycle, reduced to infinitesimal arc
flag(flag) text: what the reader of the result must know, one flag an entry

[synchrony]
clock(clock) text [required]: label of the pendulum
pair(pair) text [required]: two pendulums, first less second
phase(clock, time) rad [required, missing]: phase of the swing, unwrapped
amplitude(clock, time) rad [nonnegative, missing]: amplitude of the swing
frequency(clock) rad s-1 [positive]: mean circular frequency
phase_difference(pair, time) rad [required, missing]: phase difference, unwrapped
phase_difference_sigma(pair, time) rad [nonnegative, missing]: standard deviation of the phase difference
rate_difference(pair, time) day-1 [missing]: swings that the first makes more, at each instant
mean_rate_difference(pair) day-1: swings that the first makes more, over the record
mean_rate_difference_sigma(pair) day-1 [nonnegative]: standard deviation of the mean rate difference
verdict(pair) text [required]: in phase, antiphase, quadrature, other angle, drifting, or intermittent
confidence(pair) 1 [required, nonnegative]: probability of the verdict
locked_angle(pair) rad [missing]: phase difference at which the pair is locked
locked_angle_sigma(pair) rad [nonnegative, missing]: standard deviation of the locked angle
lock_time(pair) s [missing]: time from which the pair is locked
slips(pair) 1 [nonnegative]: whole swings that one gained on the other
slip_time(slip) s: time of a slip
slip_pair(slip) text: pair that slipped
amplitude_ratio(pair) 1 [nonnegative]: amplitude of the first over the second
beam_amplitude() m [nonnegative]: amplitude of the support's motion
beam_ratio(clock) m rad-1 [nonnegative]: amplitude of the support over that of the clock
averaging_time(averaging) s [positive]: averaging time of the Allan deviation
allan_deviation(clock, averaging) 1 [nonnegative, missing]: overlapping Allan deviation of the clock's relative rate

[summary]
record_id(row) text: identity of the record
input(row) text: input file
output(row) text: result file, below the folder of the batch
error(row) text: why there is no value
flags(row) text: flags of the method, separated by blanks
status(row) u1 [required]: what became of the input by this method
error_class(row) u1 [required]: kind of the fault
requested_method(row) u1 [required]: method that was asked for
method(row) u1 [required]: method that was used
gravity_m_s2(row) m s-2 [required, missing]: gravity
gravity_sigma_mgal(row) mGal [required, missing]: standard deviation of gravity
uncorrected_m_s2(row) m s-2 [required, missing]: gravity without any correction
noise_sigma_mgal(row) mGal [required, missing]: standard deviation of gravity by reading noise alone
correction_mgal(row) mGal [required, missing]: sum of all corrections
difference_frequency_rad_s(row) rad s-1 [required, missing]: mean phase speed of the difference, uncorrected
period_s(row) s [required, missing]: full period at infinitesimal arc
period_sigma_s(row) s [required, missing]: standard deviation of the period
samples_used(row) 1 [required, missing]: samples that were used
"""
"""Of a result, and of the summary of a batch: there one row an input and method, at the root."""
_TIME = "time(time) epoch [required, cf time]: time of the sample, from the start of the record"
_GROUPS = _rows("\n".join((_TIME, variables_record.TABLE, variables_truth.TABLE, _RESULT)))
_GROUPS[""]["time"] = replace(_GROUPS[""]["time"], attrs={"calendar": "standard", "axis": "T"})
_GROUPS["instrument"] |= {
    f"{name}_uncertainty": _uncertainty(row) for name, row in _GROUPS["instrument"].items() if row.dtype == "f8"
}
_ROWS = {f"{group}/{name}".lstrip("/"): row for group, rows in _GROUPS.items() for name, row in rows.items()}
VARIABLES: Mapping[str, Variable] = MappingProxyType(_ROWS)


def rows_of(group: str) -> Mapping[str, Variable]:
    """Rows of a group, or of the root, by the name within it."""
    return _GROUPS.get(group, {})


def add_constant(name: str, units: str, long_name: str) -> None:
    """Add a number of /instrument, and its standard deviation, to the table: a correction of one's own may need it."""
    for own, meaning in ((name, long_name), (f"{name}_uncertainty", f"standard deviation of {name}")):
        row = _ROWS.setdefault(f"instrument/{own}", Variable((), "f8", units, meaning))
        _GROUPS["instrument"].setdefault(own, row)


def attributes(key: str) -> dict[str, Any]:
    """Attributes to attach to a variable in memory: ``units``, ``long_name`` and what CF asks beside them.

    `key` is ``group/name``, or the bare name at the root. The dictionary is yours to change: set the epoch in ``units``
    of ``time`` to the record's own start. `KeyError`: the table has no such variable.

    Examples
    --------
    >>> attributes("record/elongation")["units"]
    'rad'
    """
    row = VARIABLES[key]
    named = {} if row.standard_name is None else {"standard_name": row.standard_name}
    return {"units": row.units, "long_name": row.long_name, **named, **row.attrs}


def dataset(
    group: str, values: Mapping[str, Any], coordinates: Mapping[str, Any] = MappingProxyType({}),
    extra: Mapping[str, tuple[str, str]] = MappingProxyType({}), dims: tuple[str, ...] = (),
) -> xr.Dataset:  # fmt: skip
    """A group of a file: dimensions, units and meaning of its values from the table.

    `extra` has units and meanings of values that the table does not know, all with the dimensions `dims`.
    """
    import xarray as xr

    def entry(name: str, value: Any) -> xr.Variable:
        text = isinstance(value, str) or (isinstance(value, list) and bool(value) and isinstance(value[0], str))
        data = np.asarray(value, dtype=object if text else None)
        if name in extra:
            units, long_name = extra[name]
            return xr.Variable(dims, data, {"units": units, "long_name": long_name}, fastpath=True)
        row = VARIABLES[f"{group}/{name}"]
        own = next((each for each in (row.dims, *row.also) if len(each) == data.ndim), row.dims)
        return xr.Variable(own, data, attributes(f"{group}/{name}"), fastpath=True)

    labels = {
        name: value if isinstance(value, np.ndarray) else np.array(list(value), dtype=object)
        for name, value in coordinates.items()
    }
    return xr.Dataset(*({name: entry(name, value) for name, value in each.items()} for each in (values, labels)))


_SPELLINGS = {
    "rad": "radian radians",
    "s": "sec second seconds",
    "m": "meter metre meters metres",
    "K": "kelvin Kelvin",
    "kg": "kilogram kilograms",
    "day": "d",
    "degrees": "degree deg",
    "degrees_north": "degree_north degree_N degrees_N",
    "degrees_east": "degree_east degree_E degrees_E",
    "mGal": "milligal",
}
_MEANING = {spelling: unit for unit, others in _SPELLINGS.items() for spelling in others.split()}
_FACTOR = re.compile(r"(/|per )?([A-Za-z_]+|1\b)(?:\^|\*\*)?(-?\d+)?[ .]?")
_SINCE = re.compile(r"(?:s|sec|second|seconds) since [-+]?\d{1,4}-\d{1,2}-\d{1,2}(?:[T ].*)?")


def _powers(unit: str) -> Counter[str] | None:
    """Power of each unit in a product of powers; None if it is no such product."""
    if "".join(each[0] for each in _FACTOR.finditer(unit)) != unit:
        return None
    powers: Counter[str] = Counter()
    for under, name, power in _FACTOR.findall(unit):
        one, sign = ("s", -1) if name == "Hz" else (_MEANING.get(name, name), 1)
        powers[one] += sign * (-1 if under else 1) * int(power or 1)
    del powers["1"], powers["dimensionless"]
    return powers


def same_unit(given: object, wanted: str) -> bool:
    """Whether a unit as found in a file means the unit of the table.

    A unit of time with an epoch matches any epoch.
    """
    if not isinstance(given, str):
        # a dimensionless unit is written by some as the number 1
        return wanted == "1" and given == 1
    text = given.strip()
    if " since " in wanted:
        return _SINCE.fullmatch(text) is not None
    return text == wanted or (len(text) < 40 and _powers(text) == _powers(wanted) is not None)
