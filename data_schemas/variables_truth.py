"""Rows of the table for the truth of a simulated record, which no estimator ever reads."""

from __future__ import annotations

from .variable import Variable

_PENDULUM, _TIME, _BOTH = ("pendulum",), ("time",), ("pendulum", "time")

TRUTH: dict[str, Variable] = {
    "pendulum": Variable(_PENDULUM, "str", "1", "label of the pendulum", required=True),
    "gravity": Variable((), "f8", "m s-2", "gravity, the mean of gravity_course", required=True, limit="positive"),
    "gravity_course": Variable(_TIME, "f8", "m s-2", "gravity at each time, where it changes", limit="positive"),
    "frequency": Variable(
        _PENDULUM, "f8", "rad s-1", "circular frequency at infinitesimal arc", required=True, limit="positive"
    ),
    "damping_rate": Variable(
        _PENDULUM, "f8", "s-1", "rate at which the free amplitude decays", required=True, limit="not negative"
    ),
    "kick_intensity": Variable(
        _PENDULUM, "f8", "rad s-1/2", "k of random kicks, d theta' = n k dW", limit="not negative"
    ),
    "theta": Variable(_BOTH, "f8", "rad", "elongation from the vertical without reading errors", required=True),
    "free_amplitude": Variable(
        _BOTH, "f8", "rad", "amplitude of the free harmonic", also=(_PENDULUM,), limit="not negative"
    ),
    "free_phase": Variable(_BOTH, "f8", "rad", "phase of the free harmonic", also=(_PENDULUM,)),
    "forced": Variable(_BOTH, "f8", "rad", "elongation forced by the support"),
    "horizontal_acceleration": Variable(_TIME, "f8", "m s-2", "horizontal acceleration of the support"),
    "vertical_acceleration": Variable(_TIME, "f8", "m s-2", "vertical acceleration of the support, up positive"),
    "support_displacement": Variable(
        _TIME, "f8", "m", "displacement of the support that the pendulums move: a beam downwards, others sideways"
    ),
    "case_pitch": Variable(_TIME, "f8", "rad", "tilt of the case in the plane of swing"),
    "event_time": Variable(("event",), "f8", "s", "true time of each of the scene's events, from the record's start"),
    "mark_time": Variable(("mark",), "f8", "s", "true time of the time mark, from the start of the record"),
}
