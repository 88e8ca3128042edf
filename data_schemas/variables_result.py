"""Rows of the table for a result: phases, corrections, gravity of each method, or the period of a single trace."""

from __future__ import annotations

from .variable import Variable
from .variables_record import flag_attributes

_COMPONENT_TIME, _METHOD, _METHOD_TIME = ("component", "time"), ("method",), ("method", "time")
_ENTRY, _CYCLE = ("method", "entry"), ("cycle",)
_FLAG = Variable(("flag",), "str", "1", "what the reader of the result must know, one flag an entry")

PHASES: dict[str, Variable] = {
    "component": Variable(("component",), "str", "1", "pendulum, or difference of two pendulums", required=True),
    "amplitude": Variable(
        _COMPONENT_TIME, "f8", "rad", "amplitude of the near-resonant harmonic", required=True, missing=True
    ),
    "phase": Variable(
        _COMPONENT_TIME, "f8", "rad", "phase of the near-resonant harmonic, unwrapped", required=True, missing=True
    ),
    "phase_speed": Variable(_COMPONENT_TIME, "f8", "rad s-1", "time derivative of the phase", missing=True),
    "slow": Variable(_COMPONENT_TIME, "f8", "rad", "slow forced part of the elongation", missing=True),
    "phase_qc": Variable(_COMPONENT_TIME, "u2", "1", "quality flags of the phase", attrs=flag_attributes()),
}

CORRECTION: dict[str, Variable] = {
    "method": Variable(_METHOD, "str", "1", "name of the method", required=True),
    "phase_speed_correction": Variable(
        _METHOD_TIME, "f8", "rad s-1", "correction of the phase speed, added", missing=True
    ),
    "phase_correction": Variable(_METHOD_TIME, "f8", "rad", "correction of the phase, added", missing=True),
}

GRAVITY: dict[str, Variable] = {
    "method": Variable(_METHOD, "str", "1", "name of the method", required=True),
    "gravity": Variable(
        _METHOD, "f8", "m s-2", "gravity after all corrections of the method", required=True, limit="positive",
        missing=True,
    ),
    "gravity_sigma": Variable(
        _METHOD, "f8", "mGal", "standard deviation of gravity", required=True, limit="not negative", missing=True
    ),
    "pendulum": Variable(("pendulum",), "str", "1", "label of the pendulum"),
    "frequency": Variable(
        ("method", "pendulum"), "f8", "rad s-1", "circular frequency at infinitesimal arc", limit="positive",
        missing=True,
    ),
    "frequency_sigma": Variable(
        ("method", "pendulum"), "f8", "rad s-1", "standard deviation of the circular frequency",
        limit="not negative", missing=True,
    ),
    "entry": Variable(("entry",), "str", "1", "name of the correction"),
    "value": Variable(_ENTRY, "f8", "mGal", "correction of gravity, added", missing=True),
    "sigma": Variable(
        _ENTRY, "f8", "mGal", "standard deviation of the correction; NaN where an input states none",
        limit="not negative", missing=True,
    ),
    "value_period": Variable(
        _ENTRY, "f8", "1e-7 s", "correction of the full period of the second pendulum, added", missing=True
    ),
    "applied": Variable(_ENTRY, "u1", "1", "1 where the correction is in the gravity of the method"),
    "reason": Variable(_ENTRY, "str", "1", "why the correction was applied or not"),
    "input": Variable(_ENTRY, "str", "1", "variables of the record that the correction was made from"),
    "formula": Variable(("entry",), "str", "1", "formula of the correction"),
    "formula_source": Variable(("entry",), "str", "1", "where the formula comes from"),
    "noise_sigma": Variable(
        _METHOD, "f8", "mGal", "standard deviation of gravity from the readings alone", limit="not negative",
        missing=True,
    ),
    "source": Variable(("source",), "str", "1", "what makes gravity uncertain"),
    "share": Variable(
        ("method", "source"), "f8", "1", "share of the variance of gravity that a source brings",
        limit="not negative", missing=True,
    ),
    "advice": Variable(_METHOD, "str", "1", "what to improve to halve the standard deviation"),
    "uncorrected": Variable(_METHOD, "f8", "m s-2", "gravity before any correction", missing=True),
    "normal_gravity": Variable(
        (), "f8", "m s-2", "normal gravity of GRS80 at the latitude, at the height or, below the sea, at its surface"
    ),
    "free_air_anomaly": Variable(_METHOD, "f8", "mGal", "free-air anomaly", missing=True),
    "bouguer_anomaly": Variable(_METHOD, "f8", "mGal", "simple Bouguer anomaly, the sea as rock", missing=True),
    "flag": _FLAG,
}  # fmt: skip

COURSE: dict[str, Variable] = {
    "gravity_course": Variable(
        ("time",), "f8", "m s-2", "gravity along the track, all corrections applied; its mean is that of method joint",
        required=True, limit="positive",
    ),
    "gravity_course_sigma": Variable(
        ("time",), "f8", "mGal", "standard deviation of gravity along the track", required=True, limit="not negative"
    ),
}  # fmt: skip

PERIOD: dict[str, Variable] = {
    "period": Variable(
        (), "f8", "s", "full period at infinitesimal arc", required=True, limit="positive", missing=True
    ),
    "period_sigma": Variable(
        (), "f8", "s", "standard deviation of the full period", required=True, limit="not negative", missing=True
    ),
    "cycle_time": Variable(_CYCLE, "f8", "s", "middle of the cycle, from the start of the record", missing=True),
    "amplitude": Variable(_CYCLE, "f8", "rad", "amplitude of the cycle", limit="not negative", missing=True),
    "cycle_period": Variable(_CYCLE, "f8", "s", "full period of the cycle", limit="positive", missing=True),
    "cycle_period_smoothed": Variable(
        _CYCLE, "f8", "s", "full period of the cycle, smoothed", limit="positive", missing=True
    ),
    "cycle_period_infinitesimal": Variable(
        _CYCLE, "f8", "s", "full period of the cycle, reduced to infinitesimal arc", limit="positive", missing=True
    ),
    "flag": _FLAG,
}
