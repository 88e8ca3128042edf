"""Runs the tests of a part on mutants, in forks of one process that has imported libraries but nothing of ours.

The packages and their tests are copied to a scratch folder, where each mutant takes the place of its file. Before the
first, the tests run once under coverage: a mutant is shown to those tests alone that execute its line.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import itertools
import json
import math
import os
import resource
import shutil
import signal
import struct
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

import coverage
import hypothesis
import pytest

from tests.mutation.mutants import Mutant
from tests.mutation.parts import Part

ROOT = Path(__file__).parents[2]
LEFT = (".*", "__pycache__", "*.egg-info", "build", "dist")  # not copied
LIBRARIES = "numpy scipy.signal scipy.interpolate scipy.sparse xarray h5py numba pydantic pebble netCDF4"
OPTIONS = (
    "-x",
    "-q",
    "--assert=plain",
    "-p",
    "no:cacheprovider",
    "--hypothesis-seed=0",
    "-m",
    "not campaign and not compiled",
)
MEMORY = 6 << 30  # bytes of address space that a mutant may ask for
SLOWER, LEAST = 3.0, 20.0  # times as long as without the mutant, and so many seconds, are a time-out

KILLED, SURVIVED, TIMED_OUT = "killed", "survived", "timed out"


class Scratch:
    """A copy of the repository in which one part is tested.

    Parameters
    ----------
    folder : Path
        Empty.
    part : Part
    root : Path
        Of the repository.
    least : float
        s that any mutant may take.
    """

    def __init__(self, folder: Path, part: Part, root: Path = ROOT, least: float = LEAST) -> None:
        self.folder, self._least = folder, least
        shutil.copytree(root, folder, ignore=shutil.ignore_patterns(*LEFT), dirs_exist_ok=True)
        self.files, self.tests = (
            [str(one.relative_to(folder)) for pattern in patterns for one in sorted(folder.glob(pattern))]
            for patterns in part
        )
        self._covered = coverage.CoverageData(str(folder / ".coverage"))
        self._seconds: dict[str, float] = {}

    def survey(self) -> None:
        """Run the tests under coverage, once.

        Raises
        ------
        RuntimeError
            They fail without any mutant.
        """
        if self._seconds:
            return
        words = [*OPTIONS, "--cov", "--cov-context=test", "--cov-report=", *self.tests]
        durations = self.folder / "durations"
        if self._forked(words, _Timed(durations), 3600.0) != 0:
            raise RuntimeError(f"the tests fail without a mutant:\n{self._said()[-4000:]}")
        self._seconds = json.loads(durations.read_text())
        self._covered.read()
        os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
        sys.dont_write_bytecode = True

    def try_out(self, mutant: Mutant, seconds: float = math.inf) -> tuple[str, str]:
        """Outcome, and the test that killed it or how many did not: the fastest, of so many seconds in all."""
        file = self.folder / mutant.path
        source, status = file.read_bytes(), file.stat()
        chosen = sorted(self._tests_of(mutant), key=self._seconds.__getitem__)
        if not chosen:
            return SURVIVED, "no test executes it"
        until = itertools.accumulate(self._seconds[test] for test in chosen)
        chosen = [
            test for place, (test, end) in enumerate(zip(chosen, until, strict=True)) if end < seconds or not place
        ]
        files = Counter[str]()
        for test in chosen:
            files[test.partition("::")[0]] += self._seconds[test]
        chosen.sort(key=lambda test: (files[test.partition("::")[0]], test.partition("::")[0], self._seconds[test]))
        names = sorted(files)
        file.write_bytes(mutant.applied(source))
        try:
            most = self._least + SLOWER * sum(self._seconds[test] for test in chosen)
            code = self._forked([*OPTIONS, *names], _Chosen(chosen), most)
        finally:
            file.write_bytes(source)
            os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))  # what was compiled of it holds again
        if code is None:
            return TIMED_OUT, f"{most:.0f} s"
        if code == 0:
            return SURVIVED, f"{len(chosen)} tests"
        return KILLED, next(
            (line for line in self._said().splitlines() if line.startswith(("FAILED", "ERROR"))), f"status {code}"
        )

    def _tests_of(self, mutant: Mutant) -> set[str]:
        """Tests that execute the mutant's line, or the last one before it that any test does; where a fixture does,
        which others may share, or the import, all tests of the files that do."""
        by_line = self._covered.contexts_by_lineno(str(self.folder / mutant.path))
        contexts = set(by_line.get(max((line for line in by_line if line <= mutant.line), default=0), ()))
        if imported := "" in contexts:
            contexts = {one for each in by_line.values() for one in each if one}
        shared = {one.partition("::")[0] for one in contexts if imported or not one.endswith("|run")}
        known = {one.rpartition("|")[0] for one in contexts}
        return {test for test in self._seconds if test in known or test.partition("::")[0] in shared}

    def _said(self) -> str:
        return (self.folder / "output").read_text(errors="replace")

    def _forked(self, words: list[str], plugin: object, most: float) -> int | None:
        """Exit status of pytest in a child, None where it took longer than so many seconds."""
        child = os.fork()
        if child == 0:
            code = 70
            try:
                code = self._alone(words, plugin)
            except BaseException:
                traceback.print_exc()
            finally:
                sys.stdout.flush()
                os._exit(code)
        end = time.monotonic() + most
        while not (ended := os.waitpid(child, os.WNOHANG))[0] and time.monotonic() < end:
            time.sleep(0.02)
        with contextlib.suppress(ProcessLookupError):  # and whatever it left running
            os.killpg(child, signal.SIGKILL)
        if not ended[0]:
            os.waitpid(child, 0)
            return None
        return os.waitstatus_to_exitcode(ended[1])

    def _alone(self, words: list[str], plugin: object) -> int:
        os.setsid()
        confine(self.folder)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        os.chdir(self.folder)
        output = os.open("output", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for descriptor in (1, 2):
            os.dup2(output, descriptor)
        sys.path[:] = [str(self.folder), *(one for one in sys.path if one not in ("", str(ROOT)))]
        os.environ |= {"PYTHONPATH": str(self.folder), "XDG_CACHE_HOME": str(self.folder / "cache")}
        os.environ.pop("PYTEST_ADDOPTS", None)
        os.environ["TMPDIR"] = tempfile.tempdir = str(self.folder)
        os.environ["COVERAGE_FILE"] = str(self.folder / ".coverage")
        return int(pytest.main([*words, f"--basetemp={self.folder / 'temporary'}"], plugins=[plugin]))


class _Chosen:
    """Runs the tests that were chosen, in that order."""

    def __init__(self, names: list[str]) -> None:
        self._order = {name: place for place, name in enumerate(names)}

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = sorted(
            (item for item in items if item.nodeid in self._order), key=lambda item: self._order[item.nodeid]
        )


class _Timed:
    """Writes down how long each test took that was not skipped, s."""

    def __init__(self, path: Path) -> None:
        self._path, self._seconds = path, dict[str, float]()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if not report.skipped:
            self._seconds[report.nodeid] = self._seconds.get(report.nodeid, 0.0) + report.duration

    def pytest_sessionfinish(self) -> None:
        self._path.write_text(json.dumps(self._seconds))


def confine(folder: Path) -> None:
    """Let this process and what it starts change nothing but below a folder: a mutant may write anywhere, as root too.

    Raises
    ------
    OSError
        The system has no Landlock.
    """
    call, rights = ctypes.CDLL(None, use_errno=True).syscall, 0x1FF2 | 1 << 13  # linux/landlock.h, version 2
    rules = call(444, struct.pack("Q", rights), ctypes.c_size_t(8), 0)
    for place, allowed in ((folder, rights), (Path(os.devnull), 1 << 1)):
        opened = os.open(place, os.O_PATH | os.O_CLOEXEC)
        call(445, rules, 1, struct.pack("=Qi", allowed, opened), 0)
        os.close(opened)
    if call(157, 38, 1, 0, 0, 0) or call(446, rules, 0):  # prctl: no new privileges
        raise OSError(ctypes.get_errno(), "Landlock: a mutant cannot be confined")


def warm_up() -> None:
    """Import libraries, so that forks need not; an example that kills is not made smaller."""
    for name in LIBRARIES.split():
        importlib.import_module(name)
    hypothesis.settings.register_profile("mutation", phases=[hypothesis.Phase.explicit, hypothesis.Phase.generate])
    hypothesis.settings.load_profile("mutation")
