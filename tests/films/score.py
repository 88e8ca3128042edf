"""Read films and reduce their records, by the command line; compare gravity with the truth beside them.

    python -m tests.films.score F --lines scores.jsonl

One JSON line a film is appended; films that have one are not read again. The table goes to stdout: a row a film, then
a row for each kind.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from .paper import INCH

MGAL = 1e-5  # m/s^2
_ROOT = Path(__file__).parents[2]
_COLUMNS = "film,owed,error mGal,sigma,z,late s,px,seconds,outcome"
_NUMBERS = ("error_mgal", "sigma_mgal", "z", "time_error_s", "sample_error_px")
_BLOCK = 15.0
"""s, over which a record's delay is taken as one."""
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def run(words: list[str], limit: float) -> tuple[dict[str, Any], float]:
    """First row of a verb's JSON Lines, and the seconds that it took."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "pipeline.cli", *words, "--json"]
    environment = {"OMP_NUM_THREADS": "1", **os.environ}
    try:
        done = subprocess.run(command, cwd=_ROOT, env=environment, capture_output=True, text=True, timeout=limit)
    except subprocess.TimeoutExpired:
        return {"status": "late", "error": f"{words[0]} was stopped after {limit:g} s"}, limit
    lines = done.stdout.splitlines()
    row = json.loads(lines[0]) if lines else {"status": "failed", "error": done.stderr.strip()[-400:]}
    return row, time.perf_counter() - start


def score(truth_file: Path, limit: float, method: str = "auto", accept: Iterable[str] = ()) -> dict[str, Any]:
    """Read one film: what came of it."""
    truth = json.loads(truth_file.read_text(encoding="utf-8"))
    film = truth_file.name.removesuffix(".truth.json")
    out = {name: truth[name] for name in ("kind", "group", "strength", "seed", "status", "cause")}
    out = {"film": film, "owed": out.pop("status"), **out}
    with tempfile.TemporaryDirectory() as scratch:
        record = Path(scratch) / f"{film}.record.nc"
        images = [str(truth_file.with_name(name)) for name in truth["images"]]
        words = [
            "digitise",
            *images,
            "-o",
            str(record),
            "--description",
            str(truth_file.with_name(f"{film}.film.toml")),
        ]
        row, out["digitise_s"] = run(words + (["--strips"] if len(images) > 1 else []), limit)
        out |= {"film_flags": row.get("flags", []), "reading": row.get("reading")}
        if row["status"] != "ok":
            return out | {"outcome": f"digitise {row['status']}", "error": row["error"]}
        out |= compare(record, truth) if "traces" in truth else {}
        if method == "none":
            return out | {"outcome": "read"}
        words = ["process", str(record), "-o", str(Path(scratch) / "out.nc"), "--method", method]
        row, out["process_s"] = run(words + [word for flag in accept for word in ("--accept", flag)], limit)
    out["flags"] = row.get("flags", [])
    if row["status"] != "ok" or row["gravity_m_s2"] is None:
        return out | {"outcome": f"process {row['status']}", "error": row["error"]}
    error, sigma = (row["gravity_m_s2"] - truth["gravity"]) / MGAL, row["gravity_sigma_mgal"]
    return out | {"outcome": "gravity", "error_mgal": error, "sigma_mgal": sigma, "z": error / sigma}


def compare(record: Path, truth: dict[str, Any]) -> dict[str, float]:
    """By how much a record is late, block by block, and how well its samples lie on the traces at those times.

    A record counts from a full minute, whichever; one that knows no minute may count from any mark. Where traces have
    little slow motion, a delay of a whole swing cannot be told from none.
    """
    with h5py.File(record) as file:
        times = file["time"][:]
        names = [name.decode() if isinstance(name, bytes) else name for name in file["record/trace"][:]]
        angles = file["record/elongation"][:]
        doubt = file["record/elongation_qc"][:] if "elongation_qc" in file["record"] else np.zeros(angles.shape, int)
    begin, end = truth["chronometer_offset"], truth["chronometer_offset"] + truth["duration"]
    paths, scales = [], []
    for trace in truth["traces"]:
        row_times, kept = np.unique(trace["time_of_row"], return_index=True)
        # a pendulum's place is that on paper that lies straight
        columns = np.array(trace["column_of_row"]) - np.array(truth.get("paper_of_row", 0.0))
        paths.append(make_interp_spline(row_times + begin, columns[kept], k=3))
        scales.append(trace["lever"] * truth["dpi"] / INCH)
    order = [names.index(trace["name"]) for trace in truth["traces"]]
    angles, doubt = angles[order] * np.array(scales)[:, None], doubt[order]
    good = np.isfinite(angles) & (doubt <= 1)

    def misfit(late: float, inside: Bools) -> float:
        """Root mean square over all traces, px, each trace's own mean removed."""
        square, count = 0.0, 0
        for path, angle, kept in zip(paths, angles, good & inside, strict=True):
            if kept.sum() > 10:
                error = angle[kept] - path(np.clip(times[kept] - late, begin, end))
                square, count = square + float(np.sum((error - error.mean()) ** 2)), count + int(kept.sum())
        return math.sqrt(square / count) if count else math.inf

    def best(candidates: Floats, inside: Bools) -> tuple[float, float]:
        return min((misfit(late, inside), float(late)) for late in candidates)

    everything = np.ones(times.size, bool)
    whole = np.arange(math.floor((times[0] - begin) / 0.5) - 4, math.ceil((times[-1] - end) / 0.5) + 5) * 0.5
    _, near = best(np.unique(np.concatenate([whole, np.arange(-2.0, 2.5, 0.5)])), everything)
    delays, fits = [], []
    for first in np.arange(times[0], times[-1] - 0.5 * _BLOCK, _BLOCK):
        inside = (times >= first) & (times < first + _BLOCK)
        if good[:, inside].mean() < 0.5:
            continue
        fit, late = best(near + np.arange(-6.0, 6.0, 0.02), inside)
        fit, late = best(late + np.arange(-0.02, 0.02, 0.001), inside)
        delays.append(late)
        fits.append(fit)
    if not delays:
        return {}
    return {
        "minute_error_s": (delays[0] + 30.0) % 60.0 - 30.0,
        "time_error_s": float(np.ptp(delays)),
        "sample_error_px": float(np.median(fits)),
        "unflagged": float(good.mean()),
    }


def table(rows: list[dict[str, Any]]) -> str:
    """A row a film, then the kinds in short."""
    lines = [_line(_COLUMNS.split(","))]
    for row in rows:
        numbers = [f"{row[name]:.3f}" if name in row else "" for name in _NUMBERS]
        seconds = f"{row['digitise_s']:.0f}+{row.get('process_s', 0.0):.0f}"
        said = row["outcome"] if row["outcome"] not in ("gravity", "read") else ""
        said += " " + ",".join(row["film_flags"]) + (" | " + ",".join(row.get("flags", [])) if row.get("flags") else "")
        said += " " + (row["error"].rpartition("film.tif: ")[2][:110] if row.get("error") else "")
        lines.append(_line([row["film"], row["owed"], *numbers, seconds, said.strip()]))
    lines.append("")
    for kind in dict.fromkeys(row["kind"] for row in rows):
        own = [row for row in rows if row["kind"] == kind]
        z = sorted(abs(row["z"]) for row in own if "z" in row)
        lines.append(
            f"{kind:28s} {len(own):3d} films, {len(z):3d} give gravity, largest |z| {z[-1] if z else 0.0:7.2f}"
        )
    z = [abs(row["z"]) for row in rows if "z" in row]
    beyond = [sum(value > limit for value in z) for limit in (4.0, 5.0)]
    sound = [row for row in rows if row["owed"] == "sound"]
    lost = sum(row["outcome"] not in ("gravity", "read") for row in sound)
    lines.append(
        f"{len(rows)} films, {len(z)} give gravity, {beyond[0]} beyond 4 sigma, {beyond[1]} beyond 5; "
        f"of {len(sound)} sound ones {lost} give none"
    )
    return "\n".join(lines)


def _line(words: list[str]) -> str:
    return "{:36s} {:10s} {:>11s} {:>8s} {:>8s} {:>7s} {:>7s} {:>9s}  {}".format(*words).rstrip()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--lines", type=Path, help="JSON Lines; default scores.jsonl in the folder")
    parser.add_argument("--limit", type=float, default=600.0, help="s for each verb")
    parser.add_argument("--method", default="auto", help="of process; none: films are read only")
    parser.add_argument("--accept", action="append", default=[], metavar="FLAG", help="handed on to process")
    options = parser.parse_args()
    lines = options.lines or options.folder / "scores.jsonl"
    rows = [json.loads(line) for line in lines.read_text(encoding="utf-8").splitlines()] if lines.exists() else []
    known = {row["film"] for row in rows}
    for truth in sorted(options.folder.glob("*.truth.json")):
        if truth.name.removesuffix(".truth.json") not in known:
            rows.append(score(truth, options.limit, options.method, options.accept))
            with lines.open("a", encoding="utf-8") as out:
                out.write(json.dumps(rows[-1]) + "\n")
    print(table(rows))


if __name__ == "__main__":
    main()
