"""Rows of the table for the truth of a simulated record and of an exposed film, which no estimator or reader ever sees.

Images of films count as the film lies when its rows run with time: pixel i reaches from i to i + 1, row i of the image
has its centre line at i + 0.5, and is sample i of the file's time.
"""

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


_SLICE, _MARK = ("trace", "time"), ("mark",)

SLICES: dict[str, Variable] = {
    "trace": Variable(("trace",), "str", "1", "label of the recorded trace", required=True),
    "optical_lever": Variable(("trace",), "f8", "mm rad-1", "deflection on the film per elongation", limit="positive"),
    "position": Variable(("trace",), "f8", "mm", "place of the trace across the paper at rest"),
    "offset": Variable(("trace",), "f8", "mm", "how much later along the film the trace is written"),
    "exposure_time": Variable(
        _SLICE, "f8", "s", "time at which the trace crossed the centre line of the row", required=True, missing=True
    ),
    "elongation": Variable(
        _SLICE, "f8", "rad", "elongation at that moment, as drawn", required=True, missing=True
    ),
    "column": Variable(
        _SLICE, "f8", "1", "where the trace crosses the centre line of the row, px from the image's edge",
        required=True, missing=True,
    ),
    "slope": Variable(_SLICE, "f8", "1", "slope of the trace there, columns per row", required=True, missing=True),
}  # fmt: skip

MARKS: dict[str, Variable] = {
    "mark_time": Variable(_MARK, "f8", "s", "moment in the middle of the shutter's gap", required=True),
    "mark_row": Variable(_MARK, "f8", "1", "its row at column 0 of a trace without offset, px", required=True),
    "minute": Variable(_MARK, "u1", "1", "1 for the second gap of a full minute", required=True),
    "missing": Variable(_MARK, "u1", "1", "1 where the shutter stayed open", required=True),
    "spurious": Variable(_MARK, "u1", "1", "1 for a gap that is no mark", required=True),
}
