"""Rows of the table for the truth of a simulated record and of an exposed film, which no estimator or reader ever sees.

Images of films count as the film lies when its rows run with time: pixel i reaches from i to i + 1, row i of the image
has its centre line at i + 0.5, and is sample i of the file's time.
"""

from __future__ import annotations

from .variable import Variable, f8, text, u1

TRUTH: dict[str, Variable] = {
    "pendulum": text("pendulum", "label of the pendulum", "required"),
    "gravity": f8("", "m s-2", "gravity, the mean of gravity_course", "required positive"),
    "gravity_course": f8("time", "m s-2", "gravity at each time, where it changes", "positive"),
    "frequency": f8("pendulum", "rad s-1", "circular frequency at infinitesimal arc", "required positive"),
    "damping_rate": f8("pendulum", "s-1", "rate at which the free amplitude decays", "required nonnegative"),
    "kick_intensity": f8("pendulum", "rad s-1/2", "k of random kicks, d theta' = n k dW", "nonnegative"),
    "theta": f8("pendulum time", "rad", "elongation from the vertical without reading errors", "required"),
    "free_amplitude": f8("pendulum time", "rad", "amplitude of the free harmonic", "nonnegative", also="pendulum"),
    "free_phase": f8("pendulum time", "rad", "phase of the free harmonic", also="pendulum"),
    "forced": f8("pendulum time", "rad", "elongation forced by the support"),
    "horizontal_acceleration": f8("time", "m s-2", "horizontal acceleration of the support"),
    "vertical_acceleration": f8("time", "m s-2", "vertical acceleration of the support, up positive"),
    "support_displacement": f8(
        "time", "m", "displacement of the support that the pendulums move: a beam downwards, others sideways"
    ),
    "case_pitch": f8("time", "rad", "tilt of the case in the plane of swing"),
    "event_time": f8("event", "s", "true time of each of the scene's events, from the record's start"),
    "mark_time": f8("mark", "s", "true time of the time mark, from the start of the record"),
}


SLICES: dict[str, Variable] = {
    "trace": text("trace", "label of the recorded trace", "required"),
    "optical_lever": f8("trace", "mm rad-1", "deflection on the film per elongation", "positive"),
    "position": f8("trace", "mm", "place of the trace across the paper at rest"),
    "offset": f8("trace", "mm", "how much later along the film the trace is written"),
    "exposure_time": f8(
        "trace time", "s", "time at which the trace crossed the centre line of the row", "required missing"
    ),
    "elongation": f8("trace time", "rad", "elongation at that moment, as drawn", "required missing"),
    "column": f8(
        "trace time",
        "1",
        "where the trace crosses the centre line of the row, px from the image's edge",
        "required missing",
    ),
    "slope": f8("trace time", "1", "slope of the trace there, columns per row", "required missing"),
}

MARKS: dict[str, Variable] = {
    "mark_time": f8("mark", "s", "moment in the middle of the shutter's gap", "required"),
    "mark_row": f8("mark", "1", "its row at column 0 of a trace without offset, px", "required"),
    "minute": u1("mark", "1 for the second gap of a full minute", "required"),
    "missing": u1("mark", "1 where the shutter stayed open", "required"),
    "spurious": u1("mark", "1 for a gap that is no mark", "required"),
}

GROUPS = {"truth": TRUTH, "slices": SLICES, "marks": MARKS}
