"""Rows of the table for the truth of an exposed film, which no reader of films ever sees.

Images count as the film lies when its rows run with time: pixel i reaches from i to i + 1, row i of the image has its
centre line at i + 0.5, and is sample i of the file's time.
"""

from __future__ import annotations

from .variable import Variable

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
