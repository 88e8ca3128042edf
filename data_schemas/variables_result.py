"""Rows of the table for a result, and for the summary of a batch."""

from __future__ import annotations

from .variable import Variable, f8, text, u1, u2
from .variables_record import ELONGATION_FLAGS

_FLAG = text("flag", "what the reader of the result must know, one flag an entry")
_CALENDAR = {"calendar": "standard"}
_TIME = "seconds since 2000-01-01T00:00:00Z"

PHASES: dict[str, Variable] = {
    "component": text("component", "pendulum, or difference of two pendulums", "required"),
    "amplitude": f8("component time", "rad", "amplitude of the near-resonant harmonic", "required missing"),
    "amplitude_sigma": f8(
        "component", "rad", "standard deviation of the amplitude from the readings of a window", "nonnegative missing"
    ),
    "phase": f8("component time", "rad", "phase of the near-resonant harmonic, unwrapped", "required missing"),
    "phase_sigma": f8(
        "component time", "rad", "standard deviation of the phase from the readings of a window", "nonnegative missing"
    ),
    "phase_speed": f8("component time", "rad s-1", "time derivative of the phase, central differences", "missing"),
    "slow": f8("component time", "rad", "slow forced part of the elongation", "missing"),
    "phase_qc": u2("component time", "quality flags of the phase", ELONGATION_FLAGS),
    "fictitious_amplitude": f8(
        "time", "rad", "amplitude of the fictitious pendulum theta1 - (n1/n2) theta2, slow motion and all", "missing"
    ),
    "fictitious_phase": f8("time", "rad", "phase of the fictitious pendulum, unwrapped", "missing"),
    "formula": text("formula", "formula of Panteleev (1958)"),
    "phase_speed_by_formula": f8(
        "formula time",
        "rad s-1",
        "phase speed of the difference, in (9) of the fictitious pendulum, that the formula gives",
        "missing",
    ),
    "amplitude_rate": f8("time", "rad s-1", "time derivative of the difference's amplitude", "missing"),
    "amplitude_rate_by_27": f8(
        "time", "rad s-1", "time derivative of the difference's amplitude that (26) and (27) give", "missing"
    ),
}

CORRECTION: dict[str, Variable] = {
    "estimator": text("estimator", "name of the method", "required"),
    "non_isochronism": f8("estimator time", "rad s-1", "what unequal periods and damping add, corrected", "missing"),
    "arc": f8("estimator time", "rad s-1", "what finite arcs take off, corrected", "missing"),
    "acceleration": f8("estimator time", "rad s-1", "what acceleration of the support does, corrected", "missing"),
    "phase_speed_correction": f8(
        "estimator time", "rad s-1", "correction of the phase speed, added: the sum of its parts", "missing"
    ),
    "phase_correction": f8("estimator time", "rad", "correction of the phase, added", "missing"),
    "corrected_phase_speed": f8("estimator time", "rad s-1", "phase speed of the difference, corrected", "missing"),
    "corrected_gravity": f8("estimator time", "m s-2", "gravity that the corrected phase speed stands for", "missing"),
}

GRAVITY: dict[str, Variable] = {
    "estimator": text("estimator", "name of the method", "required"),
    "gravity": f8("estimator", "m s-2", "gravity after all corrections of the method", "required positive missing"),
    "gravity_sigma": f8("estimator", "mGal", "standard deviation of gravity", "required nonnegative missing"),
    "epoch": f8("estimator", _TIME, "time that gravity holds for", attrs=_CALENDAR),
    "pendulum": text("pendulum", "label of the pendulum"),
    "frequency": f8("estimator pendulum", "rad s-1", "circular frequency at infinitesimal arc", "positive missing"),
    "frequency_sigma": f8(
        "estimator pendulum", "rad s-1", "standard deviation of the circular frequency", "nonnegative missing"
    ),
    "entry": text("entry", "name of the correction"),
    "value": f8("estimator entry", "mGal", "correction of gravity, added", "missing"),
    "sigma": f8(
        "estimator entry",
        "mGal",
        "standard deviation of the correction; 1 % of it where no input states one",
        "nonnegative missing",
    ),
    "value_period": f8(
        "estimator entry", "1e-7 s", "correction of the full period of the second pendulum, added", "missing"
    ),
    "applied": u1("estimator entry", "1 where the correction is in the gravity of the method"),
    "reason": text("estimator entry", "why the correction was applied or not"),
    "input": text("estimator entry", "variables of the record that the correction was made from"),
    "formula": text("entry", "formula of the correction"),
    "formula_source": text("entry", "where the formula comes from"),
    "noise_sigma": f8(
        "estimator", "mGal", "standard deviation of gravity from the readings alone", "nonnegative missing"
    ),
    "source": text("source", "what makes gravity uncertain"),
    "share": f8(
        "estimator source", "1", "share of the variance of gravity that a source brings", "nonnegative missing"
    ),
    "advice": text("estimator", "what to improve to halve the standard deviation"),
    "uncorrected": f8("estimator", "m s-2", "gravity before any correction", "missing"),
    "normal_gravity": f8(
        "", "m s-2", "normal gravity of GRS80 at the latitude, at the height or, below the sea, at its surface"
    ),
    "free_air_anomaly": f8("estimator", "mGal", "free-air anomaly", "missing"),
    "bouguer_anomaly": f8("estimator", "mGal", "simple Bouguer anomaly, the sea as rock", "missing"),
    "flag": _FLAG,
    "flag_meaning": text("flag", "what the flag says"),
}

COURSE: dict[str, Variable] = {
    "gravity_course": f8(
        "time",
        "m s-2",
        "gravity along the track, all corrections applied; its mean is that of method joint",
        "required positive",
    ),
    "gravity_course_sigma": f8("time", "mGal", "standard deviation of gravity along the track", "required nonnegative"),
}

SHIP: dict[str, Variable] = {
    name: f8("time", "m s-2", f"{name.replace('_', ' ')} of the support, as estimated", "missing")
    for name in ("horizontal_acceleration", "vertical_acceleration")
}

DIFFERENCE: dict[str, Variable] = {
    "record_time": f8(
        "record_time",
        _TIME,
        "time of the sample, from the start of the record",
        "required",
        attrs=_CALENDAR,
    ),
    "elongation": f8("record_time", "rad", "elongation of the difference, as read", "missing"),
    "model": f8("record_time", "rad", "elongation of the difference, as fitted", "missing"),
    "residual": f8("record_time", "rad", "elongation less what was fitted", "missing"),
}

PENDULUMS: dict[str, Variable] = {
    "pendulum": text("pendulum", "label of the pendulum", "required"),
    "record_time": DIFFERENCE["record_time"],
    "theta": f8("pendulum record_time", "rad", "angle of the pendulum from the vertical, as fitted", "missing"),
}

SPECTRUM: dict[str, Variable] = {
    "frequency": f8("frequency", "s-1", "frequency", "required nonnegative"),
    "residual_spectrum": f8("frequency", "rad2 s", "power spectral density of the residual, one-sided", "nonnegative"),
}

PERIOD: dict[str, Variable] = {
    "period": f8("", "s", "full period at infinitesimal arc", "required positive missing"),
    "period_sigma": f8("", "s", "standard deviation of the full period", "required nonnegative missing"),
    "cycle_time": f8("cycle", "s", "middle of the cycle, from the start of the record", "missing"),
    "amplitude": f8("cycle", "rad", "amplitude of the cycle", "nonnegative missing"),
    "cycle_period": f8("cycle", "s", "full period of the cycle", "positive missing"),
    "cycle_period_smoothed": f8("cycle", "s", "full period of the cycle, smoothed", "positive missing"),
    "cycle_period_infinitesimal": f8(
        "cycle", "s", "full period of the cycle, reduced to infinitesimal arc", "positive missing"
    ),
    "flag": _FLAG,
}

SYNCHRONY: dict[str, Variable] = {
    "clock": text("clock", "label of the pendulum", "required"),
    "pair": text("pair", "two pendulums, first less second", "required"),
    "phase": f8("clock time", "rad", "phase of the swing, unwrapped", "required missing"),
    "amplitude": f8("clock time", "rad", "amplitude of the swing", "nonnegative missing"),
    "frequency": f8("clock", "rad s-1", "mean circular frequency", "positive"),
    "phase_difference": f8("pair time", "rad", "phase difference, unwrapped", "required missing"),
    "phase_difference_sigma": f8(
        "pair time", "rad", "standard deviation of the phase difference", "nonnegative missing"
    ),
    "rate_difference": f8("pair time", "day-1", "swings that the first makes more, at each instant", "missing"),
    "mean_rate_difference": f8("pair", "day-1", "swings that the first makes more, over the record"),
    "mean_rate_difference_sigma": f8("pair", "day-1", "standard deviation of the mean rate difference", "nonnegative"),
    "verdict": text("pair", "in phase, antiphase, quadrature, other angle, drifting, or intermittent", "required"),
    "confidence": f8("pair", "1", "probability of the verdict", "required nonnegative"),
    "locked_angle": f8("pair", "rad", "phase difference at which the pair is locked", "missing"),
    "locked_angle_sigma": f8("pair", "rad", "standard deviation of the locked angle", "nonnegative missing"),
    "lock_time": f8("pair", "s", "time from which the pair is locked", "missing"),
    "slips": f8("pair", "1", "whole swings that one gained on the other", "nonnegative"),
    "slip_time": f8("slip", "s", "time of a slip"),
    "slip_pair": text("slip", "pair that slipped"),
    "amplitude_ratio": f8("pair", "1", "amplitude of the first over the second", "nonnegative"),
    "beam_amplitude": f8("", "m", "amplitude of the support's motion", "nonnegative"),
    "beam_ratio": f8("clock", "m rad-1", "amplitude of the support over that of the clock", "nonnegative"),
    "averaging_time": f8("averaging", "s", "averaging time of the Allan deviation", "positive"),
    "allan_deviation": f8(
        "clock averaging", "1", "overlapping Allan deviation of the clock's relative rate", "nonnegative missing"
    ),
}

SUMMARY: dict[str, Variable] = {
    "record_id": text("row", "identity of the record"),
    "input": text("row", "input file"),
    "output": text("row", "result file, below the folder of the batch"),
    "error": text("row", "why there is no value"),
    "flags": text("row", "flags of the method, separated by blanks"),
    "status": u1("row", "what became of the input by this method", "required"),
    "error_class": u1("row", "kind of the fault", "required"),
    "requested_method": u1("row", "method that was asked for", "required"),
    "method": u1("row", "method that was used", "required"),
    "gravity_m_s2": f8("row", "m s-2", "gravity", "required missing"),
    "gravity_sigma_mgal": f8("row", "mGal", "standard deviation of gravity", "required missing"),
    "uncorrected_m_s2": f8("row", "m s-2", "gravity without any correction", "required missing"),
    "noise_sigma_mgal": f8("row", "mGal", "standard deviation of gravity by reading noise alone", "required missing"),
    "correction_mgal": f8("row", "mGal", "sum of all corrections", "required missing"),
    "difference_frequency_rad_s": f8(
        "row", "rad s-1", "mean phase speed of the difference, uncorrected", "required missing"
    ),
    "period_s": f8("row", "s", "full period at infinitesimal arc", "required missing"),
    "period_sigma_s": f8("row", "s", "standard deviation of the period", "required missing"),
    "samples_used": f8("row", "1", "samples that were used", "required missing"),
}  # Of a batch: one row an input and method, at the root of its file

GROUPS = {
    "phases": PHASES,
    "correction": CORRECTION,
    "gravity": GRAVITY,
    "course": COURSE,
    "ship": SHIP,
    "difference": DIFFERENCE,
    "spectrum": SPECTRUM,
    "pendulums": PENDULUMS,
    "period": PERIOD,
    "synchrony": SYNCHRONY,
    "summary": SUMMARY,
}
