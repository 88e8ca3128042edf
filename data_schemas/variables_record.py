"""Rows of the table for a record: what was read (/record), with what (/instrument), and from which film (/film).

A quantity X of the instrument may have its standard deviation beside it as X_uncertainty.
"""

from __future__ import annotations

from dataclasses import replace

from .variable import ELONGATION_FLAGS as ELONGATION_FLAGS
from .variable import Variable, tables

GROUPS = tables("""
[record]
trace(trace) text [required]: label of the recorded trace
pendulum(pendulum) text [required]: label of the pendulum
combination(trace, pendulum) 1 [required]: weight of each pendulum's elongation in each trace
elongation(trace, time) rad [required, missing]: elongation from the vertical, combined per trace
elongation_uncertainty(trace | trace, time) rad [nonnegative, missing]: standard deviation of the white reading noise
elongation_qc(trace, time) flags: quality flags of the elongation
horizontal_acceleration(time) m s-2 [missing]: horizontal acceleration of the support in the plane of swing
vertical_acceleration(time) m s-2 [missing]: vertical acceleration of the support, up positive
case_tilt(time) rad [missing]: angle from the vertical of what elongations are measured from
time_uncertainty(time) s [nonnegative]: standard deviation of the time, the chronometer's rate apart

[instrument]
trace(trace) text: label of the recorded trace, for constants of single traces
pendulum(pendulum) text [required]: label of the pendulum
period(pendulum) s [positive]: full period at infinitesimal arc and reference gravity
reference_gravity() m s-2 [positive]: gravity at which the periods hold
damping_rate(pendulum) s-1 [nonnegative]: rate at which the free amplitude decays
scale( | trace) 1: relative error of the scale of all elongations
zero( | trace) rad: what the traces show at rest
delay( | trace) s: time by which the traces come late
horizontal_acceleration_bias() m s-2: what the horizontal accelerometer reads at rest
vertical_acceleration_bias() m s-2: what the vertical accelerometer reads at rest
vertical_acceleration_scale() 1: relative error of the vertical accelerometer's scale
vertical_acceleration_delay() s: time by which the vertical acceleration comes late
chronometer_rate() s day-1: rate of the chronometer, losing positive
temperature( | time) K [positive]: temperature of the pendulums
temperature_reference() K [positive]: temperature at which the periods hold
temperature_coefficient(pendulum) s K-1: change of the period with temperature
air_density() kg m-3 [nonnegative, cf air_density]: density of the air in the case
air_density_reference() kg m-3 [positive]: density of the air that lengthens the periods by density_coefficient
density_coefficient(pendulum) s: what air of the reference density adds to the period in vacuum
tilt_mean_square() rad2 [nonnegative]: mean square tilt of the plane of swing
yaw_rate() rad s-1: rate of turn about the vertical
transverse_acceleration_mean_square() m2 s-4 [nonnegative]: mean square acceleration across the plane of swing, where \
a gimbal makes the plane follow
rocking_rate_mean_square() rad2 s-2 [nonnegative]: mean square rate at which the plane of swing turns about a \
horizontal axis
plane_angle(pendulum) rad: angle of the plane of swing about the vertical
support_stiffness() N m-1 [positive]: horizontal stiffness of the support
mass(pendulum) kg [positive]: mass of the pendulum
length(pendulum) m [positive]: reduced length of the pendulum
latitude( | time) degrees_north [cf latitude]: latitude of the ship
longitude() degrees_east [cf longitude]: longitude of the ship
speed( | time) m s-1 [nonnegative, cf platform_speed_wrt_ground]: speed of the ship over ground
course( | time) degrees [cf platform_course]: course of the ship over ground, from north by east
height() m: height of the pendulums above the sea's surface, negative below it
water_depth() m [nonnegative]: depth of the sea below the ship
base(base) text: label of an occupation of a base station
base_time(base) s: time of the occupation, from the epoch of the record's time
base_gravity(base) m s-2 [positive]: gravity of the base station
base_period(base, pendulum) s [positive]: full period at the base, true time, infinitesimal arc, reduced to \
temperature_reference and vacuum

[film]
trace(trace) text: label of the recorded trace
optical_lever(trace) mm rad-1 [positive]: deflection on the film per elongation
speed() mm s-1 [positive]: speed of the film
mark_interval() s [positive]: interval of the time marks
gap() s [nonnegative]: length of the gap that a time mark leaves in the traces
scale() mm px-1 [positive]: size of a pixel of the scan on the film
source_file() text: name of the scanned image
source_sha256() text: SHA-256 of the scanned image
""")


def _uncertainty(row: Variable) -> Variable:
    """Standard deviation of a constant; one a variable of time has a single one."""
    units, also = row.units.partition("_")[0], tuple(dims for dims in row.also if dims != ("time",))
    meaning = f"standard deviation of the {row.long_name}"
    return replace(row, units=units, also=also, long_name=meaning, limit="not negative", standard_name=None)


INSTRUMENT = GROUPS["instrument"]
INSTRUMENT |= {f"{name}_uncertainty": _uncertainty(row) for name, row in INSTRUMENT.items() if row.dtype == "f8"}
