"""Rows of the table for a result: phases, corrections, gravity by method; the period of a single trace; synchrony."""

from __future__ import annotations

from .variable import Variable
from .variables_record import flag_attributes

_COMPONENT_TIME, _ESTIMATOR, _ESTIMATOR_TIME = ("component", "time"), ("estimator",), ("estimator", "time")
_ENTRY, _CYCLE, _RECORD_TIME = ("estimator", "entry"), ("cycle",), ("record_time",)
_FLAG = Variable(("flag",), "str", "1", "what the reader of the result must know, one flag an entry")
_TIME = "seconds since 2000-01-01T00:00:00Z"

PHASES: dict[str, Variable] = {
    "component": Variable(("component",), "str", "1", "pendulum, or difference of two pendulums", required=True),
    "amplitude": Variable(
        _COMPONENT_TIME, "f8", "rad", "amplitude of the near-resonant harmonic", required=True, missing=True
    ),
    "amplitude_sigma": Variable(
        ("component",), "f8", "rad", "standard deviation of the amplitude from the readings of a window",
        limit="not negative", missing=True,
    ),
    "phase": Variable(
        _COMPONENT_TIME, "f8", "rad", "phase of the near-resonant harmonic, unwrapped", required=True, missing=True
    ),
    "phase_sigma": Variable(
        _COMPONENT_TIME, "f8", "rad", "standard deviation of the phase from the readings of a window",
        limit="not negative", missing=True,
    ),
    "phase_speed": Variable(
        _COMPONENT_TIME, "f8", "rad s-1", "time derivative of the phase, central differences", missing=True
    ),
    "slow": Variable(_COMPONENT_TIME, "f8", "rad", "slow forced part of the elongation", missing=True),
    "phase_qc": Variable(_COMPONENT_TIME, "u2", "1", "quality flags of the phase", attrs=flag_attributes()),
    "fictitious_amplitude": Variable(
        ("time",), "f8", "rad", "amplitude of the fictitious pendulum theta1 - (n1/n2) theta2, slow motion and all",
        missing=True,
    ),
    "fictitious_phase": Variable(("time",), "f8", "rad", "phase of the fictitious pendulum, unwrapped", missing=True),
    "formula": Variable(("formula",), "str", "1", "formula of Panteleev (1958)"),
    "phase_speed_by_formula": Variable(
        ("formula", "time"), "f8", "rad s-1",
        "phase speed of the difference, in (9) of the fictitious pendulum, that the formula gives", missing=True,
    ),
    "amplitude_rate": Variable(
        ("time",), "f8", "rad s-1", "time derivative of the difference's amplitude", missing=True
    ),
    "amplitude_rate_by_27": Variable(
        ("time",), "f8", "rad s-1", "time derivative of the difference's amplitude that (26) and (27) give",
        missing=True,
    ),
}  # fmt: skip

CORRECTION: dict[str, Variable] = {
    "estimator": Variable(_ESTIMATOR, "str", "1", "name of the method", required=True),
    "non_isochronism": Variable(
        _ESTIMATOR_TIME, "f8", "rad s-1", "what unequal periods and damping add, corrected", missing=True
    ),
    "arc": Variable(_ESTIMATOR_TIME, "f8", "rad s-1", "what finite arcs take off, corrected", missing=True),
    "acceleration": Variable(
        _ESTIMATOR_TIME, "f8", "rad s-1", "what acceleration of the support does, corrected", missing=True
    ),
    "phase_speed_correction": Variable(
        _ESTIMATOR_TIME, "f8", "rad s-1", "correction of the phase speed, added: the sum of its parts", missing=True
    ),
    "phase_correction": Variable(_ESTIMATOR_TIME, "f8", "rad", "correction of the phase, added", missing=True),
    "corrected_phase_speed": Variable(
        _ESTIMATOR_TIME, "f8", "rad s-1", "phase speed of the difference, corrected", missing=True
    ),
    "corrected_gravity": Variable(
        _ESTIMATOR_TIME, "f8", "m s-2", "gravity that the corrected phase speed stands for", missing=True
    ),
}  # fmt: skip

GRAVITY: dict[str, Variable] = {
    "estimator": Variable(_ESTIMATOR, "str", "1", "name of the method", required=True),
    "gravity": Variable(
        _ESTIMATOR, "f8", "m s-2", "gravity after all corrections of the method", required=True, limit="positive",
        missing=True,
    ),
    "gravity_sigma": Variable(
        _ESTIMATOR, "f8", "mGal", "standard deviation of gravity", required=True, limit="not negative", missing=True
    ),
    "epoch": Variable(_ESTIMATOR, "f8", _TIME, "time that gravity holds for", attrs={"calendar": "standard"}),
    "pendulum": Variable(("pendulum",), "str", "1", "label of the pendulum"),
    "frequency": Variable(
        ("estimator", "pendulum"), "f8", "rad s-1", "circular frequency at infinitesimal arc", limit="positive",
        missing=True,
    ),
    "frequency_sigma": Variable(
        ("estimator", "pendulum"), "f8", "rad s-1", "standard deviation of the circular frequency",
        limit="not negative", missing=True,
    ),
    "entry": Variable(("entry",), "str", "1", "name of the correction"),
    "value": Variable(_ENTRY, "f8", "mGal", "correction of gravity, added", missing=True),
    "sigma": Variable(
        _ENTRY, "f8", "mGal", "standard deviation of the correction; 1 % of it where no input states one",
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
        _ESTIMATOR, "f8", "mGal", "standard deviation of gravity from the readings alone", limit="not negative",
        missing=True,
    ),
    "source": Variable(("source",), "str", "1", "what makes gravity uncertain"),
    "share": Variable(
        ("estimator", "source"), "f8", "1", "share of the variance of gravity that a source brings",
        limit="not negative", missing=True,
    ),
    "advice": Variable(_ESTIMATOR, "str", "1", "what to improve to halve the standard deviation"),
    "uncorrected": Variable(_ESTIMATOR, "f8", "m s-2", "gravity before any correction", missing=True),
    "normal_gravity": Variable(
        (), "f8", "m s-2", "normal gravity of GRS80 at the latitude, at the height or, below the sea, at its surface"
    ),
    "free_air_anomaly": Variable(_ESTIMATOR, "f8", "mGal", "free-air anomaly", missing=True),
    "bouguer_anomaly": Variable(_ESTIMATOR, "f8", "mGal", "simple Bouguer anomaly, the sea as rock", missing=True),
    "flag": _FLAG,
    "flag_meaning": Variable(("flag",), "str", "1", "what the flag says"),
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

SHIP: dict[str, Variable] = {
    name: Variable(("time",), "f8", "m s-2", f"{name.replace('_', ' ')} of the support, as estimated", missing=True)
    for name in ("horizontal_acceleration", "vertical_acceleration")
}

DIFFERENCE: dict[str, Variable] = {
    "record_time": Variable(
        _RECORD_TIME, "f8", _TIME, "time of the sample, from the start of the record", required=True,
        attrs={"calendar": "standard"},
    ),
    "elongation": Variable(_RECORD_TIME, "f8", "rad", "elongation of the difference, as read", missing=True),
    "model": Variable(_RECORD_TIME, "f8", "rad", "elongation of the difference, as fitted", missing=True),
    "residual": Variable(_RECORD_TIME, "f8", "rad", "elongation less what was fitted", missing=True),
}  # fmt: skip

PENDULUMS: dict[str, Variable] = {
    "pendulum": Variable(("pendulum",), "str", "1", "label of the pendulum", required=True),
    "record_time": DIFFERENCE["record_time"],
    "theta": Variable(
        ("pendulum", "record_time"), "f8", "rad", "angle of the pendulum from the vertical, as fitted", missing=True
    ),
}

SPECTRUM: dict[str, Variable] = {
    "frequency": Variable(("frequency",), "f8", "s-1", "frequency", required=True, limit="not negative"),
    "residual_spectrum": Variable(
        ("frequency",), "f8", "rad2 s", "power spectral density of the residual, one-sided", limit="not negative"
    ),
}

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


_CLOCK, _PAIR, _SLIP = ("clock",), ("pair",), ("slip",)
_CLOCK_TIME, _PAIR_TIME = ("clock", "time"), ("pair", "time")

SYNCHRONY: dict[str, Variable] = {
    "clock": Variable(_CLOCK, "str", "1", "label of the pendulum", required=True),
    "pair": Variable(_PAIR, "str", "1", "two pendulums, first less second", required=True),
    "phase": Variable(_CLOCK_TIME, "f8", "rad", "phase of the swing, unwrapped", required=True, missing=True),
    "amplitude": Variable(_CLOCK_TIME, "f8", "rad", "amplitude of the swing", limit="not negative", missing=True),
    "frequency": Variable(_CLOCK, "f8", "rad s-1", "mean circular frequency", limit="positive"),
    "phase_difference": Variable(_PAIR_TIME, "f8", "rad", "phase difference, unwrapped", required=True, missing=True),
    "phase_difference_sigma": Variable(
        _PAIR_TIME, "f8", "rad", "standard deviation of the phase difference", limit="not negative", missing=True
    ),
    "rate_difference": Variable(
        _PAIR_TIME, "f8", "day-1", "swings that the first makes more, at each instant", missing=True
    ),
    "mean_rate_difference": Variable(_PAIR, "f8", "day-1", "swings that the first makes more, over the record"),
    "mean_rate_difference_sigma": Variable(
        _PAIR, "f8", "day-1", "standard deviation of the mean rate difference", limit="not negative"
    ),
    "verdict": Variable(
        _PAIR, "str", "1", "in phase, antiphase, quadrature, other angle, drifting, or intermittent", required=True
    ),
    "confidence": Variable(_PAIR, "f8", "1", "probability of the verdict", required=True, limit="not negative"),
    "locked_angle": Variable(_PAIR, "f8", "rad", "phase difference at which the pair is locked", missing=True),
    "locked_angle_sigma": Variable(
        _PAIR, "f8", "rad", "standard deviation of the locked angle", limit="not negative", missing=True
    ),
    "lock_time": Variable(_PAIR, "f8", "s", "time from which the pair is locked", missing=True),
    "slips": Variable(_PAIR, "f8", "1", "whole swings that one gained on the other", limit="not negative"),
    "slip_time": Variable(_SLIP, "f8", "s", "time of a slip"),
    "slip_pair": Variable(_SLIP, "str", "1", "pair that slipped"),
    "amplitude_ratio": Variable(_PAIR, "f8", "1", "amplitude of the first over the second", limit="not negative"),
    "beam_amplitude": Variable((), "f8", "m", "amplitude of the support's motion", limit="not negative"),
    "beam_ratio": Variable(
        _CLOCK, "f8", "m rad-1", "amplitude of the support over that of the clock", limit="not negative"
    ),
    "averaging_time": Variable(("averaging",), "f8", "s", "averaging time of the Allan deviation", limit="positive"),
    "allan_deviation": Variable(
        ("clock", "averaging"), "f8", "1", "overlapping Allan deviation of the clock's relative rate",
        limit="not negative", missing=True,
    ),
}  # fmt: skip
