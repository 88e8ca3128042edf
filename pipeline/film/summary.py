"""What was read of a film, in one JSON object."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.film.reading import Reading, accepted_fraction, rows_per_second

if TYPE_CHECKING:
    from xarray import DataTree


def summary(record: DataTree, reading: Reading) -> dict[str, Any]:
    """Numbers of a reading and of its record, plain.

    Keys: record_id, traces, samples, duration_s, reading, accepted_fraction, missing_fraction (of the samples, by
    trace), marks, speed_mm_s, scale_mm_px, skew_degrees, time_sigma_s, flags, notes, assumed.
    """
    traces, film = record["record"].dataset, record["film"].dataset
    labels = [str(label) for label in traces["trace"].values]
    missing = np.isnan(traces["elongation"].values).mean(axis=1)
    time = record.dataset["time"].values
    return {
        "record_id": record.attrs["record_id"],
        "traces": labels,
        "samples": int(time.size),
        "duration_s": float(time[-1] - time[0]),
        "reading": reading.kind,
        "accepted_fraction": accepted_fraction(reading.tracks, reading.axis),
        "missing_fraction": {label: float(part) for label, part in zip(labels, missing, strict=True)},
        "marks": film.attrs["marks_found"],
        "speed_mm_s": rows_per_second(reading.axis) * reading.scale,
        "scale_mm_px": reading.scale,
        "skew_degrees": film.attrs["skew"],
        "time_sigma_s": film.attrs["time_sigma"],
        "flags": [part for part in str(film.attrs["flags"]).split(", ") if part],
        "notes": list(reading.notes),
        "assumed": [part for part in str(film.attrs["assumed"]).split("; ") if part],
    }


def share_read(kind: str, accepted: float, missing: float) -> str:
    """How much was read, in words: of the rows or, at the marks alone, of the places there.

    Examples
    --------
    >>> share_read("continuous", 0.9, 0.02), share_read("strobe", 0.0, 0.02)
    ('90.0 % of the rows read', '98.0 % of the places at the marks read')
    """
    if kind == "strobe":
        return f"{100.0 * (1.0 - missing):.1f} % of the places at the marks read"
    return f"{100.0 * accepted:.1f} % of the rows read"


def row_flags(reading: Reading) -> NDArray[np.uint16]:
    """Flags of every row, (traces, rows); of a film read at the marks alone, those of the nearest mark."""
    axis, strobe, flags = reading.axis, reading.strobe, reading.tracks.qc
    if reading.kind != "strobe":
        return flags
    middles = np.interp(strobe.index[1:] - 0.5, axis.index, axis.row)
    nearest = np.searchsorted(middles, np.arange(flags.shape[1]))
    return np.where(np.isfinite(axis.seconds), strobe.qc[:, nearest], flags)
