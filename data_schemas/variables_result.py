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
        _ENTRY, "f8", "mGal", "standard deviation of the correction", limit="not negative", missing=True
    ),
    "applied": Variable(_ENTRY, "u1", "1", "1 where the correction is in the gravity of the method"),
    "reason": Variable(_ENTRY, "str", "1", "why the correction was applied or not"),
    "flag": _FLAG,
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
