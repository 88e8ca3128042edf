"""Rows of the table for a record: what was read (/record), with what (/instrument), and from which film (/film).

A quantity X of the instrument may have its standard deviation beside it as X_uncertainty.
"""

from __future__ import annotations

from .variable import Variable, f8, text, u2

ELONGATION_FLAGS: dict[str, int] = {
    "gap": 1,
    "saturated": 2,
    "interpolated": 4,
    "time_mark": 8,
    "ambiguous": 16,
    "lost": 32,
    "overlap": 64,
    "single_direction": 128,
    "outlier": 256,
}


RECORD: dict[str, Variable] = {
    "trace": text("trace", "label of the recorded trace", "required"),
    "pendulum": text("pendulum", "label of the pendulum", "required"),
    "combination": f8("trace pendulum", "1", "weight of each pendulum's elongation in each trace", "required"),
    "elongation": f8("trace time", "rad", "elongation from the vertical, combined per trace", "required missing"),
    "elongation_uncertainty": f8(
        "trace", "rad", "standard deviation of the white reading noise", "nonnegative missing", also="trace time"
    ),
    "elongation_qc": u2("trace time", "quality flags of the elongation", ELONGATION_FLAGS),
    "horizontal_acceleration": f8(
        "time", "m s-2", "horizontal acceleration of the support in the plane of swing", "missing"
    ),
    "vertical_acceleration": f8("time", "m s-2", "vertical acceleration of the support, up positive", "missing"),
    "case_tilt": f8("time", "rad", "angle from the vertical of what elongations are measured from", "missing"),
    "time_uncertainty": f8("time", "s", "standard deviation of the time, the chronometer's rate apart", "nonnegative"),
}

_CONSTANTS: dict[str, Variable] = {
    "trace": text("trace", "label of the recorded trace, for constants of single traces"),
    "pendulum": text("pendulum", "label of the pendulum", "required"),
    "period": f8("pendulum", "s", "full period at infinitesimal arc and reference gravity", "positive"),
    "reference_gravity": f8("", "m s-2", "gravity at which the periods hold", "positive"),
    "damping_rate": f8("pendulum", "s-1", "rate at which the free amplitude decays", "nonnegative"),
    "scale": f8("", "1", "relative error of the scale of all elongations", also="trace"),
    "zero": f8("", "rad", "what the traces show at rest", also="trace"),
    "delay": f8("", "s", "time by which the traces come late", also="trace"),
    "horizontal_acceleration_bias": f8("", "m s-2", "what the horizontal accelerometer reads at rest"),
    "vertical_acceleration_bias": f8("", "m s-2", "what the vertical accelerometer reads at rest"),
    "vertical_acceleration_scale": f8("", "1", "relative error of the vertical accelerometer's scale"),
    "vertical_acceleration_delay": f8("", "s", "time by which the vertical acceleration comes late"),
    "chronometer_rate": f8("", "s day-1", "rate of the chronometer, losing positive"),
    "temperature": f8("", "K", "temperature of the pendulums", "positive", also="time"),
    "temperature_reference": f8("", "K", "temperature at which the periods hold", "positive"),
    "temperature_coefficient": f8("pendulum", "s K-1", "change of the period with temperature"),
    "air_density": f8("", "kg m-3", "density of the air in the case", "nonnegative", standard_name="air_density"),
    "air_density_reference": f8(
        "", "kg m-3", "density of the air that lengthens the periods by density_coefficient", "positive"
    ),
    "density_coefficient": f8("pendulum", "s", "what air of the reference density adds to the period in vacuum"),
    "tilt_mean_square": f8("", "rad2", "mean square tilt of the plane of swing", "nonnegative"),
    "yaw_rate": f8("", "rad s-1", "rate of turn about the vertical"),
    "transverse_acceleration_mean_square": f8(
        "",
        "m2 s-4",
        "mean square acceleration across the plane of swing, where a gimbal makes the plane follow",
        "nonnegative",
    ),
    "rocking_rate_mean_square": f8(
        "", "rad2 s-2", "mean square rate at which the plane of swing turns about a horizontal axis", "nonnegative"
    ),
    "plane_angle": f8("pendulum", "rad", "angle of the plane of swing about the vertical"),
    "support_stiffness": f8("", "N m-1", "horizontal stiffness of the support", "positive"),
    "mass": f8("pendulum", "kg", "mass of the pendulum", "positive"),
    "length": f8("pendulum", "m", "reduced length of the pendulum", "positive"),
    "latitude": f8("", "degrees_north", "latitude of the ship", also="time", standard_name="latitude"),
    "longitude": f8("", "degrees_east", "longitude of the ship", standard_name="longitude"),
    "speed": f8(
        "",
        "m s-1",
        "speed of the ship over ground",
        "nonnegative",
        also="time",
        standard_name="platform_speed_wrt_ground",
    ),
    "course": f8(
        "",
        "degrees",
        "course of the ship over ground, from north by east",
        also="time",
        standard_name="platform_course",
    ),
    "height": f8("", "m", "height of the pendulums above the sea's surface, negative below it"),
    "water_depth": f8("", "m", "depth of the sea below the ship", "nonnegative"),
    "base": text("base", "label of an occupation of a base station"),
    "base_time": f8("base", "s", "time of the occupation, from the epoch of the record's time"),
    "base_gravity": f8("base", "m s-2", "gravity of the base station", "positive"),
    "base_period": f8(
        "base pendulum",
        "s",
        "full period at the base, true time, infinitesimal arc, reduced to temperature_reference and vacuum",
        "positive",
    ),
}

_OF_ITS_OWN = {"latitude": "degrees", "longitude": "degrees"}


def _uncertainty(name: str, row: Variable) -> Variable:
    """Standard deviation of a constant; one a variable of time has a single one."""
    units, also = _OF_ITS_OWN.get(name, row.units), tuple(dims for dims in row.also if dims != ("time",))
    long_name = f"standard deviation of the {row.long_name}"
    return Variable(row.dims, "f8", units, long_name, also=also, limit="not negative")


INSTRUMENT: dict[str, Variable] = _CONSTANTS | {
    f"{name}_uncertainty": _uncertainty(name, row) for name, row in _CONSTANTS.items() if row.dtype == "f8"
}  # The constants, and the standard deviation of each

FILM: dict[str, Variable] = {
    "trace": text("trace", "label of the recorded trace"),
    "optical_lever": f8("trace", "mm rad-1", "deflection on the film per elongation", "positive"),
    "speed": f8("", "mm s-1", "speed of the film", "positive"),
    "mark_interval": f8("", "s", "interval of the time marks", "positive"),
    "gap": f8("", "s", "length of the gap that a time mark leaves in the traces", "nonnegative"),
    "scale": f8("", "mm px-1", "size of a pixel of the scan on the film", "positive"),
    "source_file": text("", "name of the scanned image"),
    "source_sha256": text("", "SHA-256 of the scanned image"),
}

GROUPS = {"record": RECORD, "instrument": INSTRUMENT, "film": FILM}
