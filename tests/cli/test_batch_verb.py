"""batch: one command for many inputs; what it refuses, tells and leaves; killed or interrupted it goes on."""

from __future__ import annotations

import csv
import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from made_trees import made_record
from test_process import CONTRACT

import data_schemas
import synth
from pipeline.batch.job import failure
from pipeline.batch.ledger import NAME
from pipeline.batch.summary import NAMES
from pipeline.cli.parser import processors

ROOT = Path(__file__).parents[2]
_TLS = ("--tls-ca", "ca.pem", "--tls-cert", "cert.pem", "--tls-key", "key.pem")
SERIAL = ("--method", "projection", "--executor", "serial", "--trusted")


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    path = tmp_path_factory.mktemp("good") / "a.record.nc"
    record = made_record()
    data_schemas.write(record, path)
    return path


@pytest.fixture
def cruises(tmp_path, good, monkeypatch):
    """Two good records and a damaged one, in two folders; the present folder is the one above."""
    for name in ("one/a", "one/b", "two/a"):
        path = tmp_path / "cruises" / f"{name}.record.nc"
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(good, path)
    os.truncate(tmp_path / "cruises/one/b.record.nc", 3000)
    monkeypatch.chdir(tmp_path)
    return tmp_path / "cruises"


def table(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_folder_of_records(run, cruises):
    outcome = run("batch", "cruises", "-o", "out", *SERIAL)
    assert outcome.status == 1
    damaged, alike = outcome.err.splitlines()
    assert "one/b.record.nc: its text storage is damaged" in damaged
    first, second = cruises / "one/a.record.nc", cruises / "two/a.record.nc"
    assert alike.endswith(f"2 inputs have the record id 'hand-made': {first}, {second}; are they the same record?")
    out = cruises.parent / "out"
    assert outcome.out == f"{Path('out/summary.csv')}: 2 ok (2 with flags), 1 failed of 3 inputs, 0 kept\n"
    results = sorted(str(path.relative_to(out)) for path in out.rglob("*.result.nc"))
    assert results == ["one/a.result.nc", "two/a.result.nc"]
    assert [data_schemas.validate(out / name) for name in results] == [[], []]
    first, second, third = table(out / "summary.csv")
    assert [row["status"] for row in (first, second, third)] == ["ok", "failed", "ok"]
    assert second["error_class"] == "FileError"
    assert second["gravity_m_s2"] == ""
    result = data_schemas.read(out / "one/a.result.nc")
    assert float(first["gravity_m_s2"]) == float(result["gravity"]["gravity"][0])
    events = [json.loads(line)["event"] for line in (out / "batch.log.jsonl").read_text().splitlines()]
    assert events == ["begin", "record", "record", "record", "end"]
    summary = data_schemas.read(out / "summary.nc")
    np.testing.assert_array_equal(np.isnan(summary["gravity_m_s2"]), [False, True, False])
    words = summary["status"].attrs["flag_meanings"].split()
    assert [words[code] for code in summary["status"].values] == ["ok", "failed", "ok"]
    assert summary["output"].values.tolist() == ["one/a.result.nc", "", "two/a.result.nc"]
    for name in summary.data_vars:
        assert summary[name].attrs.keys() >= {"units", "long_name"}, name


def test_going_on_does_what_is_left_and_the_summary_is_the_same(run, cruises):
    run("batch", "cruises", "-o", "whole", *SERIAL)
    outcome = run("batch", "cruises", "-o", "out", *SERIAL, "--limit", "1")
    assert outcome.status == 0
    assert "1 ok (1 with flags) of 3 inputs, 0 kept; 2 left for --resume" in outcome.out
    assert "a batch was begun there; go on with --resume" in run("batch", "cruises", "-o", "out", *SERIAL).fault
    dry = run("batch", "cruises", "-o", "out", *SERIAL, "--resume", "--dry-run", "--limit", "1")
    assert [line.split()[0] for line in dry.out.splitlines()] == ["keep", "do", "wait", "1"]
    outcome = run("batch", "cruises", "-o", "out", *SERIAL, "--resume")
    assert "2 ok (2 with flags), 1 failed of 3 inputs, 1 kept" in outcome.out
    for name in NAMES:
        assert Path("out", name).read_bytes() == Path("whole", name).read_bytes()
    again = run("batch", "cruises", "-o", "out", *SERIAL, "--resume")
    assert "3 kept" in again.out
    shutil.copy(cruises / "two/a.record.nc", cruises / "one/b.record.nc")
    mended = run("batch", "cruises", "-o", "out", *SERIAL, "--resume")
    assert mended.status == 0
    assert "3 inputs have the record id 'hand-made'" in mended.fault
    assert "3 ok (3 with flags) of 3 inputs, 2 kept" in mended.out


def test_what_other_settings_left_behind_counts_as_not_done(run, cruises):
    run("batch", "cruises", "-o", "out", *SERIAL)
    outcome = run("batch", "cruises", "-o", "out", *SERIAL, "--gain-uncertainty", "0.01", "--resume", "--limit", "1")
    assert outcome.out.endswith(": 1 ok (1 with flags) of 3 inputs, 0 kept; 2 left for --resume\n")
    assert len(table(Path("out/summary.csv"))) == 1


def test_a_full_disk_costs_the_records_it_meets_and_tells_how_to_go_on(run, cruises, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("data_schemas.writing._flushed", full)
        ended = run("batch", "cruises/two", "-o", "out", *SERIAL)
        assert ended.status == 3
        summary, result = ended.err.splitlines()
        assert summary.endswith("device; free space, or choose a folder you may write to; then --resume writes it")
        assert result.endswith(
            "a.result.nc: cannot be written, No space left on device; free space, or choose a folder "
            "you may write to; then use --retry-failed"
        )
    outcome = run("batch", "cruises/two", "-o", "out", *SERIAL, "--resume")
    assert outcome.fault.endswith("choose a folder you may write to; then use --retry-failed")
    assert run("batch", "cruises/two", "-o", "out", *SERIAL, "--retry-failed").status == 0


def test_no_space_for_the_summary_is_no_failure_of_the_records(run, cruises, monkeypatch):
    (cruises / "one/b.record.nc").unlink()
    flushed = data_schemas.writing._flushed

    def full(path, image):
        if path.parent.name == "out":
            raise OSError(errno.ENOSPC, "No space left on device")
        flushed(path, image)

    with monkeypatch.context() as patch:
        patch.setattr("data_schemas.writing._flushed", full)
        ended = run("batch", "cruises", "-o", "out", *SERIAL)
    assert ended.status == 1
    assert "summary.csv: cannot be written, No space left on device" in ended.err
    assert "2 ok (2 with flags) of 2 inputs" in ended.out
    assert run("batch", "cruises", "-o", "out", "--resume", *SERIAL).status == 0


def test_what_failed_is_tried_again_when_asked(run, cruises):
    run("batch", "cruises", "-o", "out", *SERIAL)
    lines = len(Path("out", NAME).read_text().splitlines())
    run("batch", "cruises", "-o", "out", *SERIAL, "--retry-failed")
    assert len(Path("out", NAME).read_text().splitlines()) == lines + 1
    run("batch", "cruises", "-o", "out", *SERIAL, "--force")
    assert len(Path("out", NAME).read_text().splitlines()) == lines + 4


def test_a_dry_run_makes_nothing(run, cruises):
    outcome = run("batch", "cruises", "-o", "out", "--dry-run")
    assert outcome.status == 0
    assert outcome.out.splitlines()[-1] == "3 to do, 0 to keep, 0 to wait"
    assert not Path("out").exists()


def test_json_has_the_objects_of_process_in_the_order_of_the_inputs(run, cruises):
    outcome = run("batch", "cruises", "-o", "out", *SERIAL, "--json")
    rows = [json.loads(line) for line in outcome.out.splitlines()]
    assert [row["status"] for row in rows] == ["ok", "failed", "ok"]
    for row in rows:
        assert list(row)[: len(CONTRACT)] == CONTRACT
    assert rows[0]["output"] == str(Path("out/one/a.result.nc"))
    assert rows[1]["output"] is None


def test_a_sweep_over_a_scene(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sweep = ("--sweep", "gravity=9.80,9.82", "--sweep", "recording.sampling_rate=10", "--sweep", "duration=120")
    outcome = run("batch", "linear", *sweep, "--repeat", "2", "-o", "out", *SERIAL)
    assert outcome.status == 0, outcome.err
    rows = table(Path("out/summary.csv"))
    assert [row["output"] for row in rows] == [f"linear-{number}.result.nc" for number in range(1, 5)]
    assert [row["sweep gravity"] for row in rows] == ["9.8", "9.8", "9.82", "9.82"]
    for row in rows:
        assert abs(float(row["gravity_m_s2"]) - float(row["sweep gravity"])) < 6e-5 * float(row["gravity_sigma_mgal"])
    assert rows[0]["gravity_m_s2"] != rows[1]["gravity_m_s2"]  # each has its own seed
    assert data_schemas.read("out/summary.nc")["sweep_gravity"].values.tolist() == [9.8, 9.8, 9.82, 9.82]


def test_a_scene_as_it_is_and_many_faults(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for number in range(12):
        Path(f"{number:02d}.toml").write_text("gravity = 'none'")
    outcome = run("batch", *sorted(tmp_path.glob("*.toml")), "-o", "out", *SERIAL)
    assert outcome.status == 3
    lines = outcome.err.splitlines()
    assert len(lines) == 11
    assert "00.toml: " in lines[0]
    assert lines[-1] == f"isochrony: and 2 more, see {Path('out/summary.csv')}"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--executor", "serial"], "unguarded; add --trusted if they are"),
        ([*SERIAL, "--jobs", "2"], "--executor serial has one process"),
        (["--scheduler", "tcp://x", "--jobs", "2"], "--jobs is about this machine"),
        (["--force", "--resume"], "give one of them"),
        (["--method", "projektion"], "did you mean 'projection'"),
        (["--sweep", "gravity=1,2"], "are about scenes"),
        (["--jobs", "0"], "--jobs wants a whole number from 1"),
        (["--timeout", "0"], "--timeout wants a finite number greater than 0"),
        (["--executor", "threads"], "invalid choice"),
    ],
)
def test_misuse_is_refused_before_any_work(run, cruises, words, told):
    outcome = run("batch", "cruises", "-o", "out", *words)
    assert outcome.status == 2
    assert told in outcome.fault
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["none.toml", "--sweep", "gravity=9.8"], "No such file"),
        (["a\0.toml", "--sweep", "gravity=9.8"], "null byte"),
        (["linear", "--sweep", "gravty=9.8"], "did you mean 'gravity'"),
        (["linear", "--sweep", "gravity=-1"], "gravity"),
        (["linear", "--repeat", "1000000", "--sweep", "gravity=9.7,9.8"], "more than 1000000 members"),
        (["linar"], "no scene 'linar' ships"),
    ],
)
def test_scenes_that_cannot_be_are_refused_before_any_work(run, tmp_path, monkeypatch, words, told):
    monkeypatch.chdir(tmp_path)
    outcome = run("batch", *words, "-o", "out", *SERIAL)
    assert outcome.status == 2
    assert told in outcome.fault
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--tls-ca", "ca.pem"], "--tls-ca, --tls-cert and --tls-key go together"),
        (["--scheduler", "tcp://a:1", *_TLS], "with --scheduler tls://HOST:PORT"),
        (["--scheduler", "tls://a:1", *_TLS], "ca.pem: is not a file; give the certificate or key in PEM"),
    ],
)
def test_what_secures_a_cluster_is_whole(run, cruises, words, told):
    ended = run("batch", "cruises", "-o", "out", *words)
    assert (ended.status, told in ended.err) == (2, True), ended.err


def test_nothing_of_the_user_s_is_overwritten(run, cruises):
    Path("out/two").mkdir(parents=True)
    Path("out/two/a.result.nc").write_text("precious")
    assert "exists already" in run("batch", "cruises", "-o", "out", *SERIAL).fault
    assert Path("out/two/a.result.nc").read_text() == "precious"
    assert run("batch", "cruises", "-o", cruises / "two/a.record.nc", *SERIAL).status == 2


def test_names_of_any_bytes_make_one_line_and_a_result(run, cruises, monkeypatch):
    name = os.fsdecode(b"cruises/two/\xff\x1b\n.record.nc")
    os.rename(cruises / "two/a.record.nc", name)
    dry = run("batch", name, "-o", "out", "--dry-run")
    assert len(dry.out.splitlines()) == 2
    assert "two/???.record.nc -> " in dry.out
    monkeypatch.setattr(sys, "argv", ["isochrony", "batch", name])
    assert run("batch", name, "-o", "out", *SERIAL).status == 0
    (made,) = Path("out").glob("*.result.nc")
    assert data_schemas.read(made).attrs["command"] == "isochrony batch cruises/two/\\udcff\x1b\n.record.nc"


@pytest.mark.parametrize(
    ("words", "status", "told"),
    [
        (["", "-o", "out"], 2, "an input has an empty name"),
        (["cruises", "-o", ""], 2, "-o wants a folder, not an empty name"),
        (["cruises", "-o", "a" * 300], 2, "cannot be created (File name too long)"),
        (["a" * 300, "-o", "out"], 2, "no scene 'aaa"),
        (
            [f"{'a' * 300}.record.nc", "-o", "out"],
            3,
            "cannot be read (File name too long); give the path of an existing file",
        ),
        (
            ["round.record.nc", "-o", "out"],
            3,
            "cannot be read (Too many levels of symbolic links); give the path of an existing file",
        ),
    ],
)
def test_names_that_no_file_can_have_are_told(run, cruises, words, status, told):
    Path("round.record.nc").symlink_to("round.record.nc")
    outcome = run("batch", *words, *SERIAL)
    assert outcome.status == status
    assert told in outcome.fault


def test_json_of_a_part_has_that_part(run, cruises):
    outcome = run("batch", "cruises", "-o", "out", *SERIAL, "--json", "--limit", "1")
    assert [json.loads(line)["status"] for line in outcome.out.splitlines()] == ["ok"]


def test_a_scene_as_it_is_is_that_of_simulate_and_process(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = Path("short.toml")
    text = synth.scene_path("linear").read_text(encoding="utf-8").replace("1800.0", "120.0", 1)
    scene.write_text(text, encoding="utf-8")
    assert run("batch", scene, "-o", "out", *SERIAL).status == 0
    run("simulate", scene)
    (row,) = table(Path("out/summary.csv"))
    outcome = run("process", "short.record.nc", "--method", "projection", "--json")
    assert float(row["gravity_m_s2"]) == json.loads(outcome.out)["gravity_m_s2"]


@pytest.mark.parametrize(
    ("words", "where", "wanted"),
    [
        (["--jobs", "7"], "executors.pooled", {"workers": 3, "timeout": 600.0}),
        ([], "executors.pooled", {"workers": min(processors(), 3), "timeout": 600.0}),
        (["--scheduler", "tcp://x:1", "--timeout", "5"], "cluster.clustered", {"address": "tcp://x:1", "timeout": 5.0}),
    ],
)
def test_who_does_the_work(run, cruises, monkeypatch, words, where, wanted):
    seen = {}

    def work(jobs, **settings):
        seen.update(settings)
        for _, config in jobs:
            assert config.memory == 100 << 20
            yield [failure(config.key, "Crashed", "it; died")]

    monkeypatch.setattr(f"pipeline.batch.{where}", work)
    outcome = run("batch", "cruises", "-o", "out", "--method", "projection", "--memory", "100", *words)
    assert outcome.status == 3
    assert seen.items() >= {"methods": ("projection",), **wanted}.items()


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupt_keeps_what_is_done(run, cruises, monkeypatch, number, status):
    from pipeline.batch import executors as module

    process = module.process_record

    def interrupted(path, config):
        if path.parent.name == "two":
            signal.raise_signal(number)
        return process(path, config)

    with monkeypatch.context() as patch:
        patch.setattr(module, "process_record", interrupted)
        outcome = run("batch", "cruises", "-o", "out", *SERIAL)
    assert outcome.status == status
    assert outcome.fault == "isochrony: interrupted: 2 of 3 inputs are done; the same with --resume goes on"
    assert "2 kept" in run("batch", "cruises", "-o", "out", *SERIAL, "--resume").out


def command(*words):
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, "-m", "pipeline.cli", "batch", *map(str, words)],
        env=env,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def lines_of(path):
    return path.read_bytes().count(b"\n") if path.exists() else 0


@pytest.mark.compiled
def test_killed_in_the_middle_and_interrupted_it_ends_as_if_nothing_had_been(good, tmp_path):
    """The processes of the pool, for real: kill -9, then Ctrl-C, then to the end; not a bit of the summary differs."""
    folder = tmp_path / "in"
    folder.mkdir()
    for number in range(12):
        shutil.copy(good, folder / f"{number:02d}.record.nc")
    words = [folder, "--method", "projection", "--jobs", "2"]
    out = tmp_path / "out"
    with command(*words, "-o", out) as first:
        while lines_of(out / NAME) < 4:
            time.sleep(0.01)
            assert first.poll() is None, first.stderr.read()
        first.kill()
    assert first.returncode == -signal.SIGKILL
    assert not (out / NAMES[0]).exists()
    kept = lines_of(out / NAME) - 1
    with command(*words, "-o", out, "--resume") as second:
        while lines_of(out / NAME) < kept + 4:
            time.sleep(0.01)
            assert second.poll() is None, second.stderr.read()
        second.send_signal(signal.SIGINT)
        told = second.communicate()[1]
    assert second.returncode == 130, told
    assert "isochrony: interrupted: " in told
    assert "Traceback" not in told
    kept = lines_of(out / NAME) - 1
    with command(*words, "-o", out, "--resume") as third:
        told, fault = third.communicate()
    assert third.returncode == 0, fault
    assert f"12 ok (12 with flags) of 12 inputs, {kept} kept" in told
    assert list(out.glob(".*.part")) == []
    with command(folder, *SERIAL, "-o", tmp_path / "undisturbed") as undisturbed:
        undisturbed.communicate()
    for name in NAMES:
        assert (out / name).read_bytes() == (tmp_path / "undisturbed" / name).read_bytes()
