"""`isochrony demo`: a ship record made, processed by every method and compared with the truth."""

import argparse
import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
from xarray import DataTree

import data_schemas
import synth
from data_schemas.errors import FileError, UsageError
from pipeline.cli.parser import page
from pipeline.cli.tables import columns, print_header, print_row, print_text
from pipeline.methods import DECLARED, METHODS
from pipeline.processing import process
from pipeline.summary import summaries

_MILLIGAL = 1e-5  # m s-2
_WARM = 60.0  # s


def run(options: argparse.Namespace) -> int:
    """Simulate, process, print and draw."""
    folder = _folder(options.out)
    scene = data_schemas.load_scene(synth.scene_path("demo"))
    if options.seed is not None:
        scene = scene.model_copy(update={"seed": options.seed})
    record, truth = synth.simulate(scene)
    methods = [name for name in METHODS if name != "auto"]
    # the first use loads the compiled kernels: not the methods' own time
    time = record.dataset["time"].values
    process(record.isel(time=slice(int((time < time[0] + _WARM).sum()))), method=methods)
    result = process(record, method=methods)
    for kind, tree in (("record", record), ("truth", truth), ("result", result)):
        data_schemas.write(tree, folder / f"demo.{kind}.nc", overwrite=True)
    gravity = float(truth["truth"]["gravity"])
    print(f"true gravity {gravity:.8f} m/s2; {(time[-1] - time[0]) / 60.0:.0f} minutes, {time.size} samples\n")
    _print_table(summaries(result), gravity)
    print()
    print_text(f"{_alone(result)} {page('demo')['explanation']}", 0)
    if importlib.util.find_spec("matplotlib") is None:
        print(f"no picture: matplotlib is not installed (pip install 'isochrony[plot]'); files in {folder}")
        return 0
    from pipeline.plots.canvas import save
    from pipeline.plots.result import demo_figure

    save(demo_figure(record, result, gravity), folder / "isochrony-demo.png")
    print(f"picture: {folder / 'isochrony-demo.png'}")
    return 0


def _folder(name: str) -> Path:
    folder = Path(name)
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: is a file, but the demo needs a folder; name another with -o")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise FileError(f"{folder}: cannot be created ({fault.strerror}); name another with -o") from fault
    return folder


def _print_table(rows: list[dict[str, Any]], gravity: float) -> None:
    """One row a method, and the flags below it: a flagged sigma does not promise the truth."""
    shown = columns("method <14", "what it is <23", "g m/s2 >10", "error mGal >10", "sigma >8", "ms >5")
    print_header(shown)
    raised: dict[str, list[str]] = {}
    for row in rows:
        for flag in row["flags"]:
            raised.setdefault(flag, []).append(row["method"])
        if row["status"] != "ok":
            print_row(shown, [row["method"]])
            print_text(f"{row['status']}: {row['error']}", more=2)
            continue
        error = (row["gravity_m_s2"] - gravity) / _MILLIGAL
        cells = (
            DECLARED[row["method"]].short, f"{row['gravity_m_s2']:.8f}", f"{error:+.4f}",
            f"{row['gravity_sigma_mgal']:.4f}", f"{1e3 * row['elapsed_s']:.0f}",
        )  # fmt: skip
        print_row(shown, [row["method"], *cells])
    if raised:
        print("\nflags that the results carry:")
    for flag, methods in raised.items():
        print_text(f"{flag}: {', '.join(methods)}", 2, more=2)


def _alone(result: DataTree) -> str:
    """Say what one pendulum by itself would have shown: its phase speed from moment to moment, as gravity."""
    from pipeline.plots.result import best_method, of_method

    phases, best = result["phases"].dataset, best_method(result) or "uncorrected"
    label, speed = str(phases["component"].values[0]), np.asarray(phases["phase_speed"].values)[0]
    gravity, frequency = (of_method(result, "gravity", name, best) for name in ("gravity", "frequency"))
    wander = 2.0 * gravity * (speed / frequency[0] - 1.0) / _MILLIGAL  # dg/g = 2 dn/n
    down, up = np.nanpercentile(wander, [2.5, 97.5])
    return (
        f"Pendulum {label} alone wanders by {down:+.0f} to {up:+.0f} mGal within the record: "
        "the ship shakes it near its own period."
    )
