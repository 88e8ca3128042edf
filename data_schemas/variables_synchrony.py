"""Rows of the table for what clocks on one support do to each other."""

from __future__ import annotations

from .variable import Variable

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
