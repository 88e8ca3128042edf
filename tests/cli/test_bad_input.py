"""Every bad input: one line with file, variable and remedy, exit status 2 or 3, and nothing left behind."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5netcdf
import numpy as np
import pytest
import xarray as xr
from made_trees import made_record, made_result, root

import data_schemas

ROOT = Path(__file__).parents[2]
GOOD_SCENE = """\
record_id = "small"
duration = 20.0
gravity = 9.81
[[pendulums]]
label = "1"
period = 1.0099
start = {kind = "free", amplitude = 0.01}
[[pendulums]]
label = "2"
period = 1.01
start = {kind = "free", amplitude = 0.01, phase = 2.0}
"""


def groups_of(tree: xr.DataTree) -> dict[str, xr.Dataset]:
    return {node.path: node.to_dataset(inherit=False) for node in tree.subtree}


def changed(path: Path, group: str, edit: Callable[[xr.Dataset], xr.Dataset]) -> None:
    """Write a good record of which one group was edited."""
    groups = groups_of(made_record(200))
    groups[group] = edit(groups[group])
    data_schemas.write(xr.DataTree.from_dict(groups), path)


def bytes_of(path: Path) -> bytes:
    data_schemas.write(made_record(200), path, overwrite=True)
    return path.read_bytes()


def other_times(path: Path, times: np.ndarray) -> None:
    groups = groups_of(made_record(times.size))
    groups["/"] = root(times, "record")
    data_schemas.write(xr.DataTree.from_dict(groups), path)


def with_value(name: str, value: float) -> Callable[[xr.Dataset], xr.Dataset]:
    def edit(node: xr.Dataset) -> xr.Dataset:
        node[name].values[..., -1] = value
        return node

    return edit


def traces_alike(node: xr.Dataset) -> xr.Dataset:
    node["combination"].values[:] = [[1.0, 0.0], [1.0, 0.0]]
    return node


def without_readings(node: xr.Dataset) -> xr.Dataset:
    node["elongation"].values[:] = np.nan
    return node


def damping(node: xr.Dataset) -> xr.Dataset:
    node["damping_rate"] = ("pendulum", [1e-4, -1e-4], {"units": "s-1", "long_name": "damping"})
    return node


def two_lengths(path: Path) -> None:
    with h5netcdf.File(path, "w") as file:
        file.attrs.update({"schema": "isochrony-record", "schema_version": "1", "record_id": "two-lengths"})
        file.dimensions = {"time": 50}
        time = file.create_variable("time", ("time",), float, data=np.arange(50) * 0.1)
        time.attrs["units"] = "seconds since 2000-01-01T00:00:00Z"
        group = file.create_group("record")
        group.dimensions = {"trace": 1, "pendulum": 1, "time": 60}
        for name in ("trace", "pendulum"):
            group.create_variable(name, (name,), h5netcdf.core.h5py.string_dtype(), data=np.array(["1"], dtype=object))
        group.create_variable("combination", ("trace", "pendulum"), float, data=np.ones((1, 1))).attrs["units"] = "1"
        swing = group.create_variable("elongation", ("trace", "time"), float, data=np.ones((1, 60)))
        swing.attrs["units"] = "rad"


GRID = np.arange(200) * 0.04
RECORDS: dict[str, tuple[Callable[[Path], object], list[str]]] = {
    "truncated": (lambda path: path.write_bytes(bytes_of(path)[:3000]), ["restore"]),
    "empty": (lambda path: path.write_bytes(b""), ["empty"]),
    "not HDF5": (lambda path: path.write_text("time,angle\n0,1\n"), ["HDF5"]),
    "damaged": (
        lambda path: path.write_bytes(bytes_of(path).replace(b"rad", b"deg", 1)),
        ["content_sha256", "restore"],
    ),
    "a folder": (lambda path: path.mkdir(), ["file"]),
    "not there": (lambda path: None, ["give the path"]),
    "wrong schema": (lambda path: data_schemas.write(made_result(200), path), ["schema", "isochrony-record"]),
    "NaN only": (
        lambda path: changed(path, "/record", without_readings),
        ["record/elongation", "NaN", "leave the trace out"],
    ),
    "one sample": (lambda path: other_times(path, GRID[:1]), ["time", "1 sample", "2 or more"]),
    "repeated times": (lambda path: other_times(path, np.append(GRID, GRID[-1])), ["time", "drop repeated"]),
    "decreasing times": (lambda path: other_times(path, GRID[::-1].copy()), ["time", "sort the samples"]),
    "no period": (
        lambda path: changed(path, "/instrument", lambda node: node.drop_vars("period")),
        ["instrument/period", "give"],
    ),
    "no gravity": (
        lambda path: changed(path, "/instrument", lambda node: node.drop_vars("reference_gravity")),
        ["instrument/reference_gravity", "give"],
    ),
    "two lengths": (two_lengths, ["record", "60", "length"]),
    "mismatched dimensions": (
        lambda path: changed(path, "/record", lambda node: node.rename_dims(time="reading")),
        ["record/elongation", "dimensions", "(trace, time)"],
    ),
    "no difference": (
        lambda path: changed(path, "/record", traces_alike), ["record/combination", "record one pendulum"]
    ),
    "negative damping": (
        lambda path: changed(path, "/instrument", damping), ["instrument/damping_rate", "zero or more"]
    ),
    "infinite elongation": (
        lambda path: changed(path, "/record", with_value("elongation", np.inf)),
        ["record/elongation", "infinite", "NaN"],
    ),
    "infinite period": (
        lambda path: changed(path, "/instrument", with_value("period", np.inf)),
        ["instrument/period", "finite"],
    ),
    "negative period": (
        lambda path: changed(path, "/instrument", with_value("period", -1.0)),
        ["instrument/period", "greater than"],
    ),
}  # fmt: skip

SCENES = {
    "misspelt key": (GOOD_SCENE.replace("gravity", "gravty"), ["gravty", "did you mean 'gravity'"]),
    "misspelt inner key": (GOOD_SCENE.replace("amplitude", "amplitud"), ["amplitud", "amplitude"]),
    "negative period": (GOOD_SCENE.replace("1.0099", "-1.0"), ["period", "-1.0"]),
    "infinite gravity": (GOOD_SCENE.replace("9.81", "inf"), ["gravity", "inf"]),
    "a word for a number": (GOOD_SCENE.replace("20.0", '"long"'), ["duration", "long"]),
    "negative damping": (
        GOOD_SCENE.replace('label = "1"', 'label = "1"\ndamping_rate = -1e-4'), ["damping_rate", "-0.0001"]
    ),
    "not TOML": ("record_id = = 3", ["TOML"]),
    "empty": ("", ["is empty", "scene in TOML"]),
    "not UTF-8": (b"\xff\xfe\x00", ["UTF-8"]),
}  # fmt: skip

TABLES = {
    "empty": ("", ["is empty", "as CSV"]),
    "blank": ("\n\n", ["holds no rows"]),
    "not text": (b"\x89HDF\r\n\x1a\n\0", ["UTF-8"]),
    "one sample": ("t,a\n0,1\n", ["1 sample", "at least two"]),
    "repeated times": ("t,a\n0,1\n0,2\n", ["line 3", "one row a time"]),
    "decreasing times": ("0,1\n-1,2\n", ["line 2", "sort the rows"]),
    "NaN only": ("t,a\n0,nan\n1,\n", ["column 'a'", "--column"]),
    "infinite": ("t,a\n0,inf\n1,2\n", ["line 2", "column 'a'", "correct it"]),
    "ragged": ("t,a\n0,1\n1\n", ["line 3", "delimiters"]),
    "words": ("t,a\n0,1\n1,two\n", ["line 3", "'two'", "correct it"]),
    "control characters": ("t,a\x1b[2J\n0,1\n1,\x033\n", ["line 3", "column 'a?[2J'", "'?3'"]),
    "control characters in times": ("t,a\n2024-05-01T12:00:00,1\n\x1b[2J,2\n", ["line 3", "'?[2J'"]),
}


@pytest.mark.parametrize(
    ("verb", "case"),
    [(verb, case) for verb in ("process", "plot") for case in RECORDS if (verb, case) != ("plot", "wrong schema")],
)  # a result is not what `process` takes, but `plot` draws it
def test_bad_records(run, tmp_path, unchanged, verb, case):
    make, told = RECORDS[case]
    path = tmp_path / "bad.record.nc"
    make(path)
    unchanged()
    outcome = run(verb, path, "-o", f"{tmp_path}/out/")
    assert outcome.status == 3
    assert outcome.out == ""
    assert "bad.record.nc" in outcome.fault
    assert all(word in outcome.fault for word in told), outcome.fault
    assert unchanged()
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("case", RECORDS)
def test_validate_tells_the_same_faults(run, tmp_path, case):
    make, told = RECORDS[case]
    path = tmp_path / "bad.record.nc"
    make(path)
    if case == "wrong schema":  # a good result, for validate
        assert run("validate", path) == (0, f"{path}: good\n", "")
        return
    outcome = run("validate", path)
    assert outcome.status == 3
    assert outcome.err == ""
    assert all(line.startswith(str(path)) for line in outcome.out.splitlines()), outcome.out
    assert all(word in outcome.out for word in told), outcome.out


@pytest.mark.parametrize("case", SCENES)
def test_bad_scenes(run, tmp_path, unchanged, case):
    text, told = SCENES[case]
    path = tmp_path / "bad.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    unchanged()
    outcome = run("simulate", path)
    assert outcome.status == 2
    assert outcome.out == ""
    assert "bad.toml" in outcome.fault
    assert all(word in outcome.fault for word in told), outcome.fault
    assert unchanged()
    outcome = run("validate", path)
    assert outcome.status == 3
    assert all(word in outcome.out for word in told), outcome.out


def test_the_scene_that_was_spoilt_is_good(run, tmp_path):
    path = tmp_path / "good.toml"
    path.write_text(GOOD_SCENE)
    assert run("validate", path) == (0, f"{path}: good\n", "")


@pytest.mark.parametrize("case", TABLES)
def test_bad_tables(run, tmp_path, unchanged, case):
    text, told = TABLES[case]
    path = tmp_path / "bad.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    unchanged()
    outcome = run("import", path)
    assert outcome.status == 3
    assert outcome.out == ""
    assert "bad.csv" in outcome.fault
    assert all(word in outcome.fault for word in told), outcome.fault
    assert unchanged()


@pytest.mark.parametrize("name", ["none.toml", "none", "sub/none.toml"])
def test_a_scene_that_is_not_there(run, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    outcome = run("simulate", name)
    assert outcome.status == 2
    assert Path(name).stem in outcome.fault
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "status"),
    [(["process", "bad.record.nc"], 3), (["simulate", "scene.toml"], 2), (["import", "table.csv"], 3)],
)
def test_in_a_process_of_its_own_too(tmp_path, words, status):
    (tmp_path / "bad.record.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    (tmp_path / "scene.toml").write_text("gravty = 3")
    (tmp_path / "table.csv").write_text("0,1\n0,1\n")
    before = sorted(tmp_path.iterdir())
    done = subprocess.run(
        [sys.executable, "-m", "pipeline.cli", *words],
        capture_output=True, text=True, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == status
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("isochrony: ")
    assert words[1] in done.stderr
    assert sorted(tmp_path.iterdir()) == before
