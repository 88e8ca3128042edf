"""The entry: help, version, misuse, and the exit status of every end."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from data_schemas.errors import FileError, RecordError, RefusedError, SceneError, UsageError
from pipeline.cli import main as entry
from pipeline.cli import small

ROOT = Path(__file__).parents[2]
VERBS = tuple(entry._VERBS)


def python(*words: str, **settings) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run([sys.executable, *words], capture_output=True, text=True, env=environment, **settings)


def test_help_lists_every_verb_and_the_exit_statuses(run):
    outcome = run("--help")
    assert outcome.status == 0
    for verb in VERBS:
        assert f"    {verb} " in outcome.out
    for status in ("0 ", "1 ", "2 ", "3 ", "70 ", "130 "):
        assert status in " ".join(outcome.out.partition("exit status:")[2].split())


@pytest.mark.parametrize("verb", VERBS)
def test_help_of_each_verb_describes_and_gives_examples(run, verb):
    outcome = run(verb, "--help")
    assert outcome.status == 0
    assert f"isochrony {verb}" in outcome.out.partition("examples:")[2]
    assert max(map(len, outcome.out.splitlines())) <= 80


def test_help_imports_nothing_heavy():
    code = (
        "import sys; from pipeline.cli.main import main; main(['--help']); main(['process', '--help'])\n"
        "heavy = {'numpy', 'numba', 'scipy', 'xarray', 'h5py', 'pydantic', 'matplotlib', 'tqdm'}\n"
        "sys.exit(repr(heavy & set(sys.modules)) if heavy & set(sys.modules) else 0)"
    )
    done = python("-c", code)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("said", "found"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "2"}, "2"), ({"OMP_NUM_THREADS": "4"}, None)]
)
def test_blas_has_one_thread_unless_the_user_says_otherwise(run, monkeypatch, said, found):
    monkeypatch.setattr(os, "environ", dict(said))
    assert run("--version").status == 0
    assert os.environ.get("OPENBLAS_NUM_THREADS") == found


def test_version_is_one_line(run):
    outcome = run("--version")
    assert outcome.status == 0
    assert outcome.out.startswith("isochrony ")
    assert outcome.out.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), ["a verb is missing", "process"]),
        (("proces",), ["'proces'", "did you mean 'process'"]),
        (("--versoin",), ["'--versoin'", "did you mean '--version'"]),
        (("process",), ["RECORD"]),
        (("process", "a.nc", "--metod", "auto"), ["'--metod'", "did you mean '--method'"]),
        (("process", "a.nc", "--methd=auto"), ["'--methd'", "did you mean '--method'"]),
        (("process", "a.nc", "--method", "panteleef"), ["'panteleef'", "did you mean 'panteleev'"]),
        (("process", "a.nc", "--method", "auto,auto"), ["twice"]),
        (("process", "a.nc", "--pair"), ["--pair", "expected one argument"]),
        (("process", "a.nc", "--gain-uncertainty", "-1"), ["--gain-uncertainty", "at least 0", "'-1'"]),
        (("process", "a.nc", "--gain-uncertainty", "much"), ["wants a number", "'much'"]),
        (("process", "a.nc", "--no-output", "-o", "b.nc"), ["-o and --no-output"]),
        (("schema", "recrod"), ["'recrod'", "did you mean 'record'"]),
        (("schema", "record", "truth"), ["unexpected argument 'truth'"]),
        (("import", "a.csv", "--unit", "degree"), ["'degree'", "did you mean 'deg'"]),
        (("import", "a.csv", "--lever", "0"), ["--lever", "greater than 0"]),
        (("import", "a.csv", "--gravity", "inf"), ["--gravity", "finite"]),
        (("import", "a.csv", "--period", "1="), ["--period", "NAME=VALUE"]),
        (("import", "a.csv", "--period", "1=1", "--period", "1=2"), ["'1' twice"]),
        (("import", "a.csv", "--period", "1=0"), ["--period", "greater than 0"]),
        (("simulate", "demo", "--seed", "-3"), ["--seed", "'-3'"]),
        (("simulate", "demo", "--seed", "1.5"), ["--seed", "whole number"]),
        (("benchmark", "corections"), ["'corections'", "did you mean 'corrections'"]),
    ],
)
def test_misuse_is_one_line_with_the_nearest_name_and_status_2(run, tmp_path, monkeypatch, words, told):
    monkeypatch.chdir(tmp_path)
    outcome = run(*words)
    assert outcome.status == 2
    assert outcome.out == ""
    assert all(word in outcome.fault for word in told), outcome.fault
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("fault", "status"),
    [
        (UsageError, 2),
        (SceneError, 2),
        (FileError, 3),
        (RecordError, 3),
        (RefusedError, 3),
        (KeyboardInterrupt, 130),
    ],
)
def test_every_fault_has_its_status_and_one_line(run, monkeypatch, fault, status):
    def end(_):
        raise fault("first line\n  second line")

    monkeypatch.setattr(small, "schema", end)
    outcome = run("schema", "record")
    assert outcome.status == status
    assert ("interrupted" if fault is KeyboardInterrupt else "first line second line") in outcome.fault


def test_an_interrupt_of_which_a_library_makes_an_error_is_one(run, monkeypatch):
    def end(_):
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise RuntimeError("made of it by a library") from None

    monkeypatch.setattr(small, "schema", end)
    outcome = run("schema", "record")
    assert (outcome.status, outcome.fault) == (130, "isochrony: interrupted")


def test_an_internal_error_is_70_with_one_line_and_the_traceback_on_demand(run, monkeypatch):
    def end(_):
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(small, "schema", end)
    outcome = run("schema", "record")
    assert outcome.status == 70
    assert "internal error: ZeroDivisionError: by zero (please report" in outcome.fault
    monkeypatch.setenv("ISOCHRONY_TRACEBACK", "1")
    assert "Traceback (most recent call last)" in run("schema", "record").err


def test_the_arguments_of_the_process_are_the_default(run, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["isochrony", "--version"])
    assert entry.main() == 0
    assert capsys.readouterr().out.startswith("isochrony ")


def test_an_installed_version_is_printed(run, monkeypatch):
    monkeypatch.setattr("importlib.metadata.version", lambda name: {"isochrony": "7.8.9"}[name])
    assert run("--version").out == "isochrony 7.8.9\n"


@pytest.mark.skipif(os.name != "posix", reason="needs a POSIX pipe")
def test_a_reader_that_leaves_is_no_error_message(tmp_path):
    command = f"{sys.executable} -m pipeline.cli schema record | true; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(
        ["bash", "-c", command],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.stderr == ""
    # the pipe holds 64 kB: the schema may be gone before the reader is, then all was well
    assert done.stdout.strip() in ("0", "1")


def test_a_file_name_that_is_no_utf8_is_told_and_not_fatal(tmp_path):
    done = python("-m", "pipeline.cli", "validate", os.fsdecode(b"\xff.nc"), cwd=tmp_path)
    assert done.returncode == 3
    assert done.stderr == ""
    assert "\\udcff.nc" in done.stdout


@pytest.mark.skipif(os.name != "posix", reason="needs a POSIX shell")
@pytest.mark.parametrize(
    ("where", "status", "told"),
    [
        (">&-", 0, ""),
        (">&- 2>&- <&-", 0, ""),
        pytest.param(
            "> /dev/full", 3, "isochrony: stdout cannot be written, No space left on device; free space, or send it",
            marks=pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no full device"),
        ),
    ],
)  # fmt: skip
def test_a_stdout_that_is_closed_or_full_is_no_internal_error(where, status, told):
    command = f"{sys.executable} -m pipeline.cli --version {where}"
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, cwd=ROOT, env=env)
    assert (done.returncode, done.stdout) == (status, "")
    assert done.stderr.startswith(told)
    assert len(done.stderr.splitlines()) == bool(told)


def test_streams_that_are_closed_go_nowhere_and_a_full_device_is_told(run, monkeypatch):
    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(small, "schema", full)
    outcome = run("schema", "record")
    assert outcome.status == 3
    assert "stdout cannot be written, No space left on device" in outcome.fault
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", None)
        entry._use_streams()
        with sys.stdout as nowhere:
            assert nowhere.name == os.devnull
            print("nothing")


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits address space")
def test_what_a_verb_may_hold_grows_with_its_inputs(run, tmp_path, monkeypatch):
    import resource

    seen = []

    def read(_options):
        seen.append(resource.getrlimit(resource.RLIMIT_AS)[0])
        raise MemoryError

    monkeypatch.setattr(small, "validate", read)
    before = resource.getrlimit(resource.RLIMIT_AS)
    for size in (1, 1 << 28):
        (tmp_path / "a.nc").touch()
        os.truncate(tmp_path / "a.nc", size)
        outcome = run("validate", str(tmp_path / "a.nc"))
        assert outcome.status == 3
        assert outcome.fault.endswith("may not hold so much memory: one is damaged or too large; split it")
    assert resource.getrlimit(resource.RLIMIT_AS) == before
    assert seen[1] - seen[0] == pytest.approx(50 * (1 << 28), rel=0.02)


@pytest.mark.parametrize(
    ("verb", "hidden"), [("process", True), ("benchmark", False), ("batch", False), ("demo", False)]
)
def test_dask_is_hidden_from_xarray_where_nothing_uses_it(verb: str, hidden: bool) -> None:
    """`benchmark batch` and `batch` start clusters of it."""
    told = (
        "import contextlib, sys; from pipeline.cli.main import main; "
        f"sys.argv = ['isochrony', '{verb}', '--help']\n"
        "with contextlib.suppress(SystemExit): main()\n"
        "print(sys.modules.get('dask', 1) is None)"
    )
    done = python("-c", told, check=True)
    assert done.stdout.splitlines()[-1] == str(hidden)
