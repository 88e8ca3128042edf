"""Rows of the table for a record: what was read (/record), with what (/instrument), and from which film (/film).

A quantity X of the instrument may have its standard deviation beside it as X_uncertainty.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .variable import Variable

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


def flag_attributes() -> dict[str, Any]:
    """``flag_masks`` and ``flag_meanings`` of the quality variables, the masks of the variable's own type (CF 3.5)."""
    return {
        "flag_masks": np.array(list(ELONGATION_FLAGS.values()), dtype=np.uint16),
        "flag_meanings": " ".join(ELONGATION_FLAGS),
    }


_TRACE, _PENDULUM, _TIME, _TRACE_TIME = ("trace",), ("pendulum",), ("time",), ("trace", "time")
_BASE = ("base",)


RECORD: dict[str, Variable] = {
    "trace": Variable(_TRACE, "str", "1", "label of the recorded trace", required=True),
    "pendulum": Variable(_PENDULUM, "str", "1", "label of the pendulum", required=True),
    "combination": Variable(
        ("trace", "pendulum"), "f8", "1", "weight of each pendulum's elongation in each trace", required=True
    ),
    "elongation": Variable(
        _TRACE_TIME, "f8", "rad", "elongation from the vertical, combined per trace", required=True, missing=True
    ),
    "elongation_uncertainty": Variable(
        _TRACE, "f8", "rad", "standard deviation of the white reading noise", also=(_TRACE_TIME,),
        limit="not negative", missing=True,
    ),
    "elongation_qc": Variable(_TRACE_TIME, "u2", "1", "quality flags of the elongation", attrs=flag_attributes()),
    "horizontal_acceleration": Variable(
        _TIME, "f8", "m s-2", "horizontal acceleration of the support in the plane of swing", missing=True
    ),
    "vertical_acceleration": Variable(
        _TIME, "f8", "m s-2", "vertical acceleration of the support, up positive", missing=True
    ),
    "case_tilt": Variable(
        _TIME, "f8", "rad", "angle from the vertical of what elongations are measured from", missing=True
    ),
    "time_uncertainty": Variable(
        _TIME, "f8", "s", "standard deviation of the time, the chronometer's rate apart", limit="not negative"
    ),
}  # fmt: skip

_CONSTANTS: dict[str, Variable] = {
    "trace": Variable(_TRACE, "str", "1", "label of the recorded trace, for constants of single traces"),
    "pendulum": Variable(_PENDULUM, "str", "1", "label of the pendulum", required=True),
    "period": Variable(
        _PENDULUM, "f8", "s", "full period at infinitesimal arc and reference gravity", limit="positive"
    ),
    "reference_gravity": Variable((), "f8", "m s-2", "gravity at which the periods hold", limit="positive"),
    "damping_rate": Variable(
        _PENDULUM, "f8", "s-1", "rate at which the free amplitude decays", limit="not negative"
    ),
    "scale": Variable((), "f8", "1", "relative error of the scale of all elongations", also=(_TRACE,)),
    "zero": Variable((), "f8", "rad", "what the traces show at rest", also=(_TRACE,)),
    "delay": Variable((), "f8", "s", "time by which the traces come late", also=(_TRACE,)),
    "horizontal_acceleration_bias": Variable((), "f8", "m s-2", "what the horizontal accelerometer reads at rest"),
    "vertical_acceleration_bias": Variable((), "f8", "m s-2", "what the vertical accelerometer reads at rest"),
    "vertical_acceleration_scale": Variable((), "f8", "1", "relative error of the vertical accelerometer's scale"),
    "vertical_acceleration_delay": Variable((), "f8", "s", "time by which the vertical acceleration comes late"),
    "chronometer_rate": Variable((), "f8", "s day-1", "rate of the chronometer, losing positive"),
    "temperature": Variable((), "f8", "K", "temperature of the pendulums", also=(_TIME,), limit="positive"),
    "temperature_reference": Variable((), "f8", "K", "temperature at which the periods hold", limit="positive"),
    "temperature_coefficient": Variable(_PENDULUM, "f8", "s K-1", "change of the period with temperature"),
    "air_density": Variable(
        (), "f8", "kg m-3", "density of the air in the case", standard_name="air_density", limit="not negative"
    ),
    "air_density_reference": Variable(
        (), "f8", "kg m-3", "density of the air that lengthens the periods by density_coefficient", limit="positive"
    ),
    "density_coefficient": Variable(
        _PENDULUM, "f8", "s", "what air of the reference density adds to the period in vacuum"
    ),
    "tilt_mean_square": Variable((), "f8", "rad2", "mean square tilt of the plane of swing", limit="not negative"),
    "yaw_rate": Variable((), "f8", "rad s-1", "rate of turn about the vertical"),
    "transverse_acceleration_mean_square": Variable(
        (), "f8", "m2 s-4", "mean square acceleration across the plane of swing, where a gimbal makes the plane follow",
        limit="not negative",
    ),
    "rocking_rate_mean_square": Variable(
        (), "f8", "rad2 s-2", "mean square rate at which the plane of swing turns about a horizontal axis",
        limit="not negative",
    ),
    "plane_angle": Variable(_PENDULUM, "f8", "rad", "angle of the plane of swing about the vertical"),
    "support_stiffness": Variable((), "f8", "N m-1", "horizontal stiffness of the support", limit="positive"),
    "mass": Variable(_PENDULUM, "f8", "kg", "mass of the pendulum", limit="positive"),
    "length": Variable(_PENDULUM, "f8", "m", "reduced length of the pendulum", limit="positive"),
    "latitude": Variable((), "f8", "degrees_north", "latitude of the ship", also=(_TIME,), standard_name="latitude"),
    "longitude": Variable((), "f8", "degrees_east", "longitude of the ship", standard_name="longitude"),
    "speed": Variable(
        (), "f8", "m s-1", "speed of the ship over ground", also=(_TIME,),
        standard_name="platform_speed_wrt_ground", limit="not negative",
    ),
    "course": Variable(
        (), "f8", "degrees", "course of the ship over ground, from north by east", also=(_TIME,),
        standard_name="platform_course",
    ),
    "height": Variable((), "f8", "m", "height of the pendulums above the sea's surface, negative below it"),
    "water_depth": Variable((), "f8", "m", "depth of the sea below the ship", limit="not negative"),
    "base": Variable(_BASE, "str", "1", "label of an occupation of a base station"),
    "base_time": Variable(_BASE, "f8", "s", "time of the occupation, from the epoch of the record's time"),
    "base_gravity": Variable(_BASE, "f8", "m s-2", "gravity of the base station", limit="positive"),
    "base_period": Variable(
        ("base", "pendulum"), "f8", "s",
        "full period at the base, true time, infinitesimal arc, reduced to temperature_reference and vacuum",
        limit="positive",
    ),
}  # fmt: skip

_OF_ITS_OWN = {"latitude": "degrees", "longitude": "degrees"}
INSTRUMENT: dict[str, Variable] = _CONSTANTS | {
    f"{name}_uncertainty": Variable(
        row.dims, "f8", _OF_ITS_OWN.get(name, row.units), f"standard deviation of the {row.long_name}",
        also=tuple(dims for dims in row.also if dims != _TIME), limit="not negative",
    )
    for name, row in _CONSTANTS.items()
    if row.dtype == "f8"
}  # fmt: skip
"""The constants, and the standard deviation of each."""

FILM: dict[str, Variable] = {
    "trace": Variable(_TRACE, "str", "1", "label of the recorded trace"),
    "optical_lever": Variable(_TRACE, "f8", "mm rad-1", "deflection on the film per elongation", limit="positive"),
    "speed": Variable((), "f8", "mm s-1", "speed of the film", limit="positive"),
    "mark_interval": Variable((), "f8", "s", "interval of the time marks", limit="positive"),
    "gap": Variable((), "f8", "s", "length of the gap that a time mark leaves in the traces", limit="not negative"),
    "scale": Variable((), "f8", "mm px-1", "size of a pixel of the scan on the film", limit="positive"),
    "source_file": Variable((), "str", "1", "name of the scanned image"),
    "source_sha256": Variable((), "str", "1", "SHA-256 of the scanned image"),
}
