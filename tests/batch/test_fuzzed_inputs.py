"""Mutated inputs: no end of the process that reads them, no hang, no traceback, whatever the bytes."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from batch_parts import METHODS, config_of, write_record

import synth
from data_schemas.errors import IsochronyError
from pipeline.batch.executors import Isolated
from pipeline.batch.job import Kind
from pipeline.cli.batch import digitise_film, read_record, simulate_scene
from pipeline.importing.record import import_csv

HANG = 10.0  # s


def import_table(path, _config, _allow):
    """A table of one pendulum, as `isochrony import` takes it."""
    return import_csv(path)


KINDS = {
    "record.nc": Kind("record", (".record.nc",), read_record),
    "toml": Kind("scene", (".toml",), simulate_scene),
    "csv": Kind("table", (".csv",), import_table),
    "tif": Kind("film", (".tif",), digitise_film),
}


def scene(path):
    text = synth.scene_path("linear").read_text(encoding="utf-8")
    path.write_text(text.replace("duration = 1800.0", "duration = 30.0"), encoding="utf-8")


def table(path):
    time = np.arange(300) * 0.04
    path.write_text("time,angle\n" + "".join(f"{t:.2f},{np.cos(6.2 * t):.6f}\n" for t in time))


def film(path):
    """Two wavy lines, in deflated strips."""
    tifffile = pytest.importorskip("tifffile")
    rows, columns = np.arange(600)[:, None], np.arange(80)
    paper = 215.0 + 3.0 * np.random.default_rng(0).standard_normal((600, 80))
    for middle, turn in ((25.0, 9.41), (55.0, 9.43)):
        line = middle + 12.0 * np.sin(rows / turn)
        paper -= 150.0 * np.exp(-0.5 * ((columns - line) / 1.2) ** 2)
    tifffile.imwrite(path, np.clip(paper, 0, 255).astype(np.uint8), compression="zlib", rowsperstrip=64, predictor=True)


MAKERS = {"record.nc": write_record, "toml": scene, "csv": table, "tif": film}


def mutated(whole, draw):
    """Bytes changed, cut out, doubled, put in from elsewhere, or numbers made extreme; one to eight times."""
    bad = bytearray(whole)
    for _ in range(draw.integers(1, 9)):
        at = int(draw.integers(len(bad) + 1))
        length = int(draw.integers(1, 64))
        match draw.integers(6):
            case 0:
                bad[at : at + 1] = draw.bytes(1)
            case 1:
                del bad[at : at + length]
            case 2:
                bad[at:at] = bad[at : at + length] * int(draw.integers(1, 9))
            case 3:
                bad[at : at + length] = draw.bytes(length)
            case 4:
                other = int(draw.integers(len(bad) + 1))
                bad[at:at] = bad[other : other + length]
            case _:
                extremes = (b"\xff" * 8, b"\0" * 8, b"nan", b"1e999", b"-9" * 30, b"[" * 2000, b"\n", b"=", b'"""')
                bad[at : at + 8] = extremes[draw.integers(len(extremes))]
    return bytes(bad)


def rehearse(path, films):
    """Compile what reads films here and keep it, where a child finds it: compiling is no hang."""
    for film in films:
        path.write_bytes(film)
        with contextlib.suppress(IsochronyError):
            digitise_film(path, None, lambda _: None)


def fuzz(tmp_path, out, ending, count, seed):
    good = tmp_path / f"good.{ending}"
    MAKERS[ending](good)
    whole = good.read_bytes()
    draw = np.random.default_rng(seed)
    config = config_of(out, "a", kind=KINDS[ending], memory=512 << 20)
    path = tmp_path / f"bad.{ending}"
    faults = []
    if ending == "tif":
        same = np.random.default_rng(seed)
        rehearse(path, [whole, *(mutated(whole, same) for _ in range(200))])
    with Isolated(METHODS, HANG) as child:
        first = child.run(good, config)
        assert first.error_class in (None, "RecordError", "RefusedError"), first.error
        for _ in range(count):
            bad = mutated(whole, draw)
            path.write_bytes(bad)
            one = child.run(path, config)
            told = one.error or ""
            if one.error_class in ("Crashed", "TimedOut", "WorkerLost") or "internal error" in told:
                faults.append((one.error_class, told, bad))
            assert told.isprintable()
            assert "Traceback" not in told
            assert (one.status == "ok") == (one.error is None)
    return faults


@pytest.mark.compiled
@pytest.mark.parametrize(("ending", "count"), [("record.nc", 600), ("toml", 200), ("csv", 200), ("tif", 60)])
def test_mutated_inputs(tmp_path, out, ending, count):
    assert fuzz(tmp_path, out, ending, count, seed=1) == []


@pytest.mark.campaign
@pytest.mark.parametrize(("ending", "count"), [("record.nc", 12_000), ("toml", 4_000), ("csv", 4_000), ("tif", 4_000)])
def test_many_mutated_inputs(tmp_path, out, ending, count):
    assert fuzz(tmp_path, out, ending, count, seed=2) == []
