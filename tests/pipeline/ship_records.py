"""Records of two or three pendulums aboard ships, everything drawn by chance: seas, gaps, and what may be wrong.

    python -m tests.pipeline.ship_records --seeds 1000:1010 --folder F
    python -m tests.pipeline.ship_records --seeds 1007:1008 --folder F --drop jump --set '{"minutes": 6}' --process

Writes NAME.record.nc and NAME.truth.json. Four records in ten have no fault, the others one to three of `FAULTS`.
Seeds from 1000 on give shorter records. Simulated by `ship_motion` and `ship_readings`, which share no code with the
product. With --process, `isochrony process` reduces each, and a line says how far it was from the truth.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tests.pipeline.ship_motion import DAY, MGAL, Draft, Random, Spec, log_uniform, ship_of, signed, swing
from tests.pipeline.ship_readings import Readings, combinations_of, read

FAULTS = {
    "zero": "traces have zeros",
    "zerodrift": "and these drift",
    "casetilt": "the case, from which elongations are read, tilts",
    "casetilt_rec": "the same, but its tilt is recorded",
    "acc_bias": "the vertical accelerometer has a bias, which drifts",
    "acc_scale": "it has a wrong scale",
    "acc_delay": "it is late",
    "acc_noise": "it is noisy",
    "acc_sign": "it has the other sign",
    "acc_gap": "it has gaps",
    "acc_cross": "it feels horizontal acceleration",
    "knocks": "the support is knocked",
    "owkick": "single pendulums are kicked",
    "selfkick": "pendulums are kicked at random all the time",
    "clip": "a trace is clipped",
    "stick": "traces stick for a while",
    "quant": "elongations come in units",
    "bursts": "bursts of noise",
    "touched": "pendulums are touched and started again",
    "jitter": "times are uncertain",
    "jump": "the clock jumps",
    "rateerr": "the chronometer's rate is wrong, within a large stated uncertainty",
    "tracedelay": "a trace is late",
    "quadratic": "quadratic drag",
    "friction": "dry friction",
    "tempdrift": "temperature drifts, and is recorded",
    "gain": "a trace has a wrong scale",
    "gaindrift": "the scales drift",
    "crosstalk": "traces show some of the other pendulums",
    "optics": "the optics are not linear",
    "coloured": "noise is coloured",
    "noisier": "noise is larger for a while",
    "hum": "a tone of the mains or of another machine",
    "dies": "a trace dies",
    "perioderr": "periods are wrong, within their stated uncertainty",
    "swapped": "two traces are exchanged",
    "flip": "a trace has the other sign",
    "baseties": "periods come from base stations before and after",
    "gcourse": "gravity changes along the way",
    "gturn": "the ship turns: the Eotvos effect changes",
    "sway": "the support yields to the pendulums",
    "exposure": "each elongation is a mean over some time",
    "roundtime": "uneven times are rounded",
    "filled": "gaps are filled with straight lines",
    "planes": "pendulums swing in other planes",
    "scalecommon": "all scales are wrong, within their stated uncertainty",
    "offedge": "a trace runs off its edge",
}
"""In the order in which they are drawn by number."""
_CONTRARY = (
    ("casetilt", "casetilt_rec"),
    ("acc_sign", "acc_scale"),
    ("gcourse", "gturn"),
    ("tempdrift", "baseties"),
)
"""Of these, a record has but the first."""
_SEAS = {"calm": (1e-3, 1e-2), "moderate": (1e-2, 0.1), "heavy": (0.1, 0.35)}
"""Root mean square of x'', m/s^2."""
_LAYOUTS = {
    2: (("1", "1-2"), ("1", "2"), ("1", "2"), ("1-2", "2"), ("1", "2", "1-2"), ("1", "2-1")),
    3: (("1", "2", "3"), ("1", "1-2", "2-3"), ("1", "1-2", "1-3"), ("2", "1-2", "3-2"), ("1", "2", "1-3")),
}
_LAYOUTS_OF_SHORT = tuple(dict.fromkeys(_LAYOUTS[2]))
_SHORT = 1000
"""Seeds from here on give shorter records."""
_MOST, _MOST_OF_SHORT = 70000, 30000
"""Samples."""
_UNITS = {
    "air_density": "kg m-3",
    "air_density_reference": "kg m-3",
    "base_gravity": "m s-2",
    "base_period": "s",
    "base_time": "s",
    "case_tilt": "rad",
    "chronometer_rate": "s day-1",
    "course": "degrees",
    "damping_rate": "s-1",
    "density_coefficient": "s",
    "elongation": "rad",
    "horizontal_acceleration": "m s-2",
    "latitude": "degrees_north",
    "period": "s",
    "reference_gravity": "m s-2",
    "speed": "m s-1",
    "temperature": "K",
    "temperature_coefficient": "s K-1",
    "temperature_reference": "K",
    "tilt_mean_square": "rad2",
    "time": "s",
    "vertical_acceleration": "m s-2",
}
"""Of an uncertainty those of its quantity; what is not here has none."""
_FLAGS = "gap saturated interpolated time_mark ambiguous lost overlap single_direction outlier"
_EPOCH = "2026-05-01T00:00:00Z"
_ROOT = Path(__file__).parents[2]


def draw(seed: int) -> Spec:
    """All that the record of a seed is made with."""
    random = np.random.default_rng([77, seed])
    spec: Spec = {"seed": seed, "linear": False} | _pendulums(random)
    spec |= _sampling(random, spec["periods"])
    spec |= _sea(random)
    spec |= _reading(random, len(spec["periods"]))
    if seed >= _SHORT:
        _shorten(spec, np.random.default_rng([76, seed]))
    random = np.random.default_rng([78, seed])
    faults: list[str] = []
    if random.random() >= 0.4:
        count = int(random.choice([1, 1, 2, 2, 3]))
        faults = random.choice(list(FAULTS), count, replace=False).tolist()
    for name, other in _CONTRARY:
        if name in faults and other in faults:
            faults.remove(other)
    spec["records_heave"] |= any(name.startswith("acc_") for name in faults)
    spec["temperature"] |= "tempdrift" in faults
    if "swapped" in faults and min(abs(part) for part in spec["apart"]) < 1e-3:
        faults[faults.index("swapped")] = "gain"  # nobody could see that
    return spec | {"faults": faults}


def _pendulums(random: Random) -> Spec:
    """Two or three pendulums, and gravity where they are."""
    count, kind, uniform = 2 if random.random() < 0.7 else 3, random.random(), random.uniform
    period = 1 + uniform(0, 0.04) if kind < 0.6 else uniform(0.7, 1.3) if kind < 0.8 else uniform(1.3, 2.0)
    apart = [signed(random, 1e-5, 5e-2) for _ in range(3)]
    spec: Spec = {"periods": [period * (1 + apart[0]), period, period * (1 + apart[2])][:count]}
    spec |= {"apart": [apart[0], apart[2]][: count - 1], "reference_gravity": uniform(9.78, 9.832)}
    change = uniform(-300, 300) if random.random() < 0.85 else uniform(-2500, 2500)
    spec["gravity"] = float(np.round(spec["reference_gravity"] + change * MGAL, 7))
    rate = log_uniform(random, 1e-5, 3e-4)
    damping = [abs(rate * (1 + 0.2 * random.normal())) if random.random() < 0.8 else rate for _ in range(count)]
    spec["states_damping"] = bool(random.random() < 0.6)
    if not spec["states_damping"]:  # equal to 3 per cent, as twins are
        damping = [rate * (1 + 0.03 * random.normal()) for _ in range(count)]
    amplitudes = [log_uniform(random, 0.005, 0.05) for _ in range(count)]
    phases = [uniform(0, 2 * np.pi) for _ in range(count)]
    if random.random() < 0.4:
        phases[1] = phases[0] + np.pi + 0.1 * random.normal()
    return spec | {"damping": damping, "amplitudes": amplitudes, "phases": phases}


def _sampling(random: Random, periods: list[float]) -> Spec:
    """How long, how often and how well is read."""
    minutes = log_uniform(random, 5, 60) if random.random() < 0.9 else 5.0
    at_marks = bool(random.random() < 0.15)
    if at_marks:
        rate = float(random.choice([2.0, 2.0, 2.0, 1 / 0.4, 1 / 0.3]))
    elif random.random() < 0.7:
        rate = float(np.round(log_uniform(random, 2.5 / min(periods), 50), 1))
    else:
        rate = float(random.choice([4, 5, 10, 20, 25]))
    if not at_marks:
        minutes = min(minutes, _MOST / 60 / rate)
    spec: Spec = {"minutes": minutes, "at_marks": at_marks, "rate": rate}
    return spec | {"noise": log_uniform(random, 1e-6, 3e-4), "states_noise": bool(random.random() < 0.6)}


def _sea(random: Random) -> Spec:
    """What moves the ship."""
    kind, uniform = random.random(), random.uniform
    sea = "calm" if kind < 0.3 else "moderate" if kind < 0.75 else "heavy"
    sway = log_uniform(random, *_SEAS[sea])
    spec: Spec = {"sea": sea, "sway": sway, "heave": sway * uniform(0.5, 1.5), "swell_period": uniform(6, 15)}
    spec["depth"] = float(random.choice([0, 0, 20.0]))
    windy = random.random() < 0.4 and spec["depth"] == 0
    spec |= {"wind": uniform(0.1, 0.5) if windy else 0.0, "wind_period": uniform(2.2, 5), "hull": [], "engine": None}
    if random.random() < 0.3:  # part of g, Hz
        spec["hull"] = [(log_uniform(random, 1e-6, 1e-4), uniform(0.9, 1.1)) for _ in range(random.integers(1, 3))]
    if random.random() < 0.3:
        spec["engine"] = (log_uniform(random, 1e-5, 3e-3), log_uniform(random, 1.7, 12))
    changes = random.random() < 0.4
    spec["envelope"] = str(random.choice(["squall", "ramp", "groups"])) if changes else None
    spec["turn"] = None
    if random.random() < 0.2:  # share of the record, s, m/s, s
        place, length = uniform(0.15, 0.85), uniform(25, 150)
        spec["turn"] = [place, length, uniform(0.5, 6) * float(random.choice([-1, 1])), uniform(4, 12)]
    return spec


def _reading(random: Random, count: int) -> Spec:
    """What is recorded and stated, and where the gaps are."""
    uniform = random.uniform
    spec: Spec = {"records_heave": bool(random.random() < 0.55), "records_sway": bool(random.random() < 0.12)}
    spec["states_restoring"] = bool(random.random() < 0.7)
    spec["layout"] = list(_LAYOUTS[count][random.integers(len(_LAYOUTS[count]))])
    broken = random.random() < 0.35
    gaps = random.integers(1, 6) if broken else 0  # share of the record, s
    spec["gaps"] = [[uniform(0.05, 0.9), log_uniform(random, 0.5, 60)] for _ in range(gaps)]
    spec["gap_kind"] = str(random.choice(["nan", "rows", "qc"]))
    spec["start"] = float(random.choice([0, 0, 0, 1234.5, 0.5 * DAY]))
    spec["chronometer_rate"] = uniform(-5, 5) if random.random() < 0.25 else None
    spec |= {"air": bool(random.random() < 0.2), "temperature": bool(random.random() < 0.2)}
    spec["tilt"] = log_uniform(random, 1e-7, 1e-5) if random.random() < 0.1 else None
    return spec


def _shorten(spec: Spec, random: Random) -> None:
    """Fewer minutes, and fewer records of three pendulums."""
    spec["minutes"] = log_uniform(random, 5, 22) if random.random() < 0.88 else log_uniform(random, 22, 60)
    if len(spec["periods"]) == 3 and random.random() < 0.5:
        spec |= {name: spec[name][:2] for name in ("periods", "damping", "amplitudes", "phases")}
        spec["apart"] = spec["apart"][:1]
        spec["layout"] = list(_LAYOUTS_OF_SHORT[random.integers(len(_LAYOUTS_OF_SHORT))])
    if not spec["at_marks"] and spec["minutes"] * 60 * spec["rate"] > _MOST_OF_SHORT:
        spec["minutes"] = max(5.0, _MOST_OF_SHORT / 60 / spec["rate"])


def tree_of(draft: Draft, readings: Readings, label: str) -> xr.DataTree:
    """The record, without the samples that are left out."""
    spec, stamps = draft.spec, readings.stamps
    kept = np.ones(stamps.size, bool)
    for begin, length in draft.gaps if spec["gap_kind"] == "rows" else ():
        kept &= ~((stamps >= begin) & (stamps < begin + length))
    record = _record(draft, readings, kept)
    stated = {name: (dims, values, _meaning(name)) for name, (dims, values) in draft.instrument.items()}
    names = {"trace": spec["layout"], "pendulum": [str(k + 1) for k in range(len(spec["periods"]))]}
    names["base"] = ["before", "after"]
    labels = {name: (name, np.array(values, dtype=object), _meaning(name)) for name, values in names.items()}
    used = ["pendulum", "base"] if "base_time" in stated else ["pendulum"]
    law = {"restoring": "linear" if spec["linear"] else "sine"} if spec["states_restoring"] else {}
    reference = {"reference": "case"} if "casetilt_rec" in spec["faults"] else {}
    time = _meaning("time") | {"units": f"seconds since {_EPOCH}", "standard_name": "time", "calendar": "standard"}
    heads = {"Conventions": "CF-1.11", "schema": "isochrony-record", "schema_version": "1", "record_id": label}
    heads |= {"title": "pendulums aboard", "history": "independent simulator", "source": "model"}
    return xr.DataTree.from_dict(
        {
            "/": xr.Dataset(coords={"time": ("time", stamps[kept] + spec["start"], time)}, attrs=heads),
            "/record": xr.Dataset(record, {name: labels[name] for name in ("trace", "pendulum")}, reference),
            "/instrument": xr.Dataset(stated, {name: labels[name] for name in used}, law),
        }
    )


def _record(draft: Draft, readings: Readings, kept: NDArray[np.bool_]) -> dict[str, Any]:
    """Variables of the group `record`."""
    spec, seen = draft.spec, ("trace", "time")
    combinations = combinations_of(spec["layout"], len(spec["periods"]))
    record: dict[str, Any] = {
        "combination": (("trace", "pendulum"), combinations, _meaning("combination")),
        "elongation": (seen, readings.angles[:, kept], _meaning("elongation")),
    }
    if spec["states_noise"]:
        sigma = np.full(len(combinations), spec["noise"])
        record["elongation_uncertainty"] = ("trace", sigma, _meaning("elongation_uncertainty"))
    if readings.doubt is not None:
        flags = {"flag_masks": (1 << np.arange(9)).astype(np.uint16), "flag_meanings": _FLAGS}
        record["elongation_qc"] = (seen, readings.doubt[:, kept], _meaning("elongation_qc") | flags)
    return record | {name: ("time", values[kept], _meaning(name)) for name, values in readings.beside.items()}


def _meaning(name: str) -> dict[str, Any]:
    """Attributes of a variable."""
    units = _UNITS.get(name) or _UNITS.get(name.removesuffix("_uncertainty"), "1")
    return {"units": units, "long_name": name}


def write(seed: int, folder: Path, dropped: Iterable[str] = (), changes: Spec | None = None) -> Path:
    """Write the record of a seed and its truth; `changes` are entries of the spec."""
    spec, label = draw(seed), f"ship-{seed}"
    spec["faults"] = [name for name in spec["faults"] if name not in dropped]
    draft = Draft(spec | (changes or {}))
    ship = ship_of(draft)
    motion = swing(draft, ship)
    readings = read(draft, ship, motion)
    path = folder / f"{label}.record.nc"
    path.unlink(missing_ok=True)
    tree = tree_of(draft, readings, label)
    tree.to_netcdf(path, engine="h5netcdf")
    truth = {"gravity": draft.spec["gravity"], "spec": draft.spec, "fault_parameters": draft.known}
    truth |= {"largest_angles": np.abs(motion.steps[0]).max(axis=1), "samples": tree["time"].size}
    truth |= {"sway_over_g": motion.sway, "heave_over_g": motion.heave}
    text = json.dumps(truth, indent=1, default=lambda value: value.tolist())
    (folder / f"{label}.truth.json").write_text(text, encoding="utf-8")
    return path


def process(record: Path, limit: float) -> str:
    """Reduce a record by the command line: error, sigma, their ratio, CPU time and flags, in a line."""
    truth = json.loads(record.with_name(record.name.replace(".record.nc", ".truth.json")).read_text(encoding="utf-8"))
    result = record.with_name(record.name.replace(".record.nc", ".result.nc"))
    command = [sys.executable, "-m", "pipeline.cli", "process", str(record), "-o", str(result), "--force", "--json"]
    before = os.times()
    try:
        done = subprocess.run(command, cwd=_ROOT, capture_output=True, text=True, timeout=limit)
        lines, failure = done.stdout.splitlines(), done.stderr.strip()[-300:]
    except subprocess.TimeoutExpired:
        lines, failure = [], f"stopped after {limit:g} s"
    after = os.times()
    seconds = after.children_user + after.children_system - before.children_user - before.children_system
    row = json.loads(lines[-1]) if lines else {"status": "failed", "error": failure}
    text = f"{record.name.removesuffix('.record.nc'):10s} {'+'.join(truth['spec']['faults']) or 'plain':28s} "
    if row.get("gravity_m_s2") is None:
        text += f"{row['status']}: {row.get('error')}"
    else:
        error, sigma = (row["gravity_m_s2"] - truth["gravity"]) / MGAL, row["gravity_sigma_mgal"]
        text += f"error {error:.4g} mGal, sigma {sigma:.4g}, z {error / sigma:.2f}"
    return f"{text}, CPU {seconds:.1f} s {','.join(row.get('flags') or [])}".rstrip()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1000:1010", metavar="A:B")
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--drop", default="", metavar="FAULT,...", help="leave these faults out")
    parser.add_argument("--set", default="{}", metavar="JSON", help="entries of the spec to replace, as in the truth")
    parser.add_argument("--process", action="store_true", help="reduce each record, and compare with the truth")
    parser.add_argument("--limit", type=float, default=900.0, help="s for each record")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    first, stop = map(int, options.seeds.split(":"))
    for seed in range(first, stop):
        path = write(seed, options.folder, options.drop.split(","), json.loads(options.set))
        print(process(path, options.limit) if options.process else path, flush=True)


if __name__ == "__main__":
    main()
