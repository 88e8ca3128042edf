"""Rows of the table for the truth of a simulated record and of an exposed film, which no estimator or reader ever sees.

Images of films count as the film lies when its rows run with time: pixel i reaches from i to i + 1, row i of the image
has its centre line at i + 0.5, and is sample i of the file's time.
"""

from __future__ import annotations

from .variable import tables

GROUPS = tables("""
[truth]
pendulum(pendulum) text [required]: label of the pendulum
gravity() m s-2 [required, positive]: gravity, the mean of gravity_course
gravity_course(time) m s-2 [positive]: gravity at each time, where it changes
frequency(pendulum) rad s-1 [required, positive]: circular frequency at infinitesimal arc
damping_rate(pendulum) s-1 [required, nonnegative]: rate at which the free amplitude decays
kick_intensity(pendulum) rad s-1/2 [nonnegative]: k of random kicks, d theta' = n k dW
theta(pendulum, time) rad [required]: elongation from the vertical without reading errors
free_amplitude(pendulum, time | pendulum) rad [nonnegative]: amplitude of the free harmonic
free_phase(pendulum, time | pendulum) rad: phase of the free harmonic
forced(pendulum, time) rad: elongation forced by the support
horizontal_acceleration(time) m s-2: horizontal acceleration of the support
vertical_acceleration(time) m s-2: vertical acceleration of the support, up positive
support_displacement(time) m: displacement of the support that the pendulums move: a beam downwards, others sideways
case_pitch(time) rad: tilt of the case in the plane of swing
event_time(event) s: true time of each of the scene's events, from the record's start
mark_time(mark) s: true time of the time mark, from the start of the record

[slices]
trace(trace) text [required]: label of the recorded trace
optical_lever(trace) mm rad-1 [positive]: deflection on the film per elongation
position(trace) mm: place of the trace across the paper at rest
offset(trace) mm: how much later along the film the trace is written
exposure_time(trace, time) s [required, missing]: time at which the trace crossed the centre line of the row
elongation(trace, time) rad [required, missing]: elongation at that moment, as drawn
column(trace, time) 1 [required, missing]: where the trace crosses the centre line of the row, px from the image's edge
slope(trace, time) 1 [required, missing]: slope of the trace there, columns per row

[marks]
mark_time(mark) s [required]: moment in the middle of the shutter's gap
mark_row(mark) 1 [required]: its row at column 0 of a trace without offset, px
minute(mark) u1 [required]: 1 for the second gap of a full minute
missing(mark) u1 [required]: 1 where the shutter stayed open
spurious(mark) u1 [required]: 1 for a gap that is no mark
""")
