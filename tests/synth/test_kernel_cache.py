"""Compiled code is kept for whoever comes next, and only what he can read."""

from __future__ import annotations

import ast
import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from synth.kernels import cache, compiled
from synth.systems.resistance import Viscous


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Home without a cache, and its own folder for temporary files."""
    cache.cache_folder.cache_clear()
    for name in ("ISOCHRONY_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, "")  # so that what the product sets is taken back
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "common"))
    for name in ("home", "common", "work"):
        (tmp_path / name).mkdir(mode=0o700)
    monkeypatch.chdir(tmp_path / "work")
    yield tmp_path
    cache.cache_folder.cache_clear()


def test_kernels_are_kept_at_home(kept: Path) -> None:
    folder = cache.cache_folder()
    assert folder.parent == kept / "home/.cache/isochrony"
    assert folder.stat().st_mode & 0o777 == folder.parent.stat().st_mode & 0o777 == 0o700


def test_where_kernels_are_kept_is_known_without_numba() -> None:
    code = "import sys; from synth.kernels.cache import cache_folder; cache_folder(); sys.exit('numba' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_link_of_the_cache_to_a_safe_place_is_followed(kept: Path) -> None:
    (kept / "scratch").mkdir()
    (kept / "home/.cache").symlink_to(kept / "scratch")
    assert cache.cache_folder().resolve().parent == kept / "scratch/isochrony"


@pytest.mark.parametrize("home", ["", "relative"])
def test_no_cache_is_made_beside_the_data(home: str, kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", home)
    monkeypatch.setenv("HOME", home)
    assert cache.cache_folder().is_relative_to(kept / "common")
    assert list((kept / "work").iterdir()) == []


PLANTED = ["a link", "open to all", "open to a group", "a link below", "a parent open to all", "open to all below"]


@pytest.mark.parametrize("planted", [*PLANTED, "of somebody else below", "under a home of somebody else"])
def test_kernels_of_a_folder_that_others_may_write_to_are_never_loaded(planted: str, kept: Path) -> None:
    name = cache.cache_folder().name
    cache.cache_folder.cache_clear()
    base, foreign = kept / "home/.cache/isochrony", kept / "foreign"
    foreign.mkdir()
    match planted:
        case "a link":
            base.rename(kept / "elsewhere")
            base.symlink_to(kept / "elsewhere")
        case "open to all" | "open to a group":
            base.chmod(0o777 if "all" in planted else 0o770)
        case "a parent open to all":
            base.parent.chmod(0o777)
        case "open to all below":
            (base / name / "below").mkdir()
            (base / name / "below/kernel.nbi").touch()
            (base / name / "below/kernel.nbi").chmod(0o666)
        case "of somebody else below" | "under a home of somebody else":
            if not hasattr(os, "getuid") or os.getuid() != 0:
                pytest.skip("only root can give a file away")
            (base / name / "below").mkdir()
            os.chown(base / name / "below" if "below" in planted else kept / "home", 65534, 65534)
        case _:
            (base / name / "below").symlink_to(foreign)
    folder = cache.cache_folder()
    assert folder.is_relative_to(kept / "common")
    assert folder.stat().st_mode & 0o777 == 0o700
    # whoever is started from here finds it
    cache.cache_folder.cache_clear()
    assert cache.cache_folder() == folder


def test_only_kernels_of_installations_unused_for_long_are_removed(kept: Path) -> None:
    base = kept / "home/.cache/isochrony"
    names = [f"{number:016x}" for number in range(6)]
    for name in [*names, "notes"]:
        (base / name).mkdir(parents=True)
        used = time.time() - (20.0 + 4.0 * int(name, 16)) * 86400.0 if name != "notes" else 0.0
        os.utime(base / name, (used, used))
    base.chmod(0o700)
    folder = cache.cache_folder()
    assert {each.name for each in base.iterdir()} == {"notes", folder.name, *names[:3]}


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="only root can be two users")
def test_another_users_folder_in_the_common_place_is_left_alone(tmp_path: Path) -> None:
    """A home that cannot be written, and a planted folder of the name that was guessed."""
    common = tmp_path / "common"
    common.mkdir()
    for each in (common, *common.parents[: len(common.parents) - 2]):
        each.chmod(each.stat().st_mode | 0o055)
    common.chmod(0o1777)
    planted = common / "isochrony-65534"
    planted.mkdir()
    planted.chmod(0o777)
    # what the interpreter reads of versions it may not read as somebody else
    code = (
        "import os; from synth.kernels import cache;"
        "cache.version = {name: cache.version(name) for name in cache._RUNS_WITH}.get;"
        "os.setuid(65534); print(cache.cache_folder())"
    )
    given = {**os.environ, "HOME": "/nonexistent", "XDG_CACHE_HOME": "", "TMPDIR": str(common), "ISOCHRONY_CACHE": ""}
    ran = subprocess.run([sys.executable, "-c", code], env=given, capture_output=True, text=True, check=True)
    folder = Path(ran.stdout.strip())
    assert folder.is_relative_to(common)
    assert not folder.is_relative_to(planted)
    assert list(planted.iterdir()) == []


class Foreign(NamedTuple):
    """As a user's script may define one."""

    rate: float


def add_one(value: Any) -> Any:
    """What is compiled."""
    return value[0] + 1.0


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("argument", "kept"),
    [
        (Viscous(np.array([1.0])), True),
        ((1.0, 2.0), True),
        (Foreign(1.0), False),
        ((1.0, Foreign(2.0)), False),
    ],
)
def test_only_types_of_the_project_are_kept(
    argument: Any, kept: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An index that names a module which is not there cannot be read by anybody else."""
    monkeypatch.setattr(compiled, "cache_folder", lambda: tmp_path)
    made = compiled.making_kernel(add_one)
    assert np.all(made(argument) == 2.0)
    assert bool(list(tmp_path.rglob("*.nbi"))) == kept
    if kept:
        again: Any = compiled.making_kernel(add_one)
        again(argument)
        assert sum(again.stats.cache_hits.values()) == 1


@pytest.mark.compiled
def test_of_one_kernel_the_last_four_kinds_of_sources_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "cache_folder", lambda: tmp_path)
    for number in range(6):
        monkeypatch.setattr(compiled, "stamp", lambda *_, name=f"{number:016x}": name)
        compiled.kernel(add_one)((1.0,))
        for index in tmp_path.glob(f"*{number:016x}.nbi"):
            os.utime(index, (number, number))
    assert sorted(each.stem[-16:] for each in tmp_path.glob("*.nbi")) == [f"{number:016x}" for number in range(2, 6)]
    assert len(list(tmp_path.iterdir())) == 8


MODULES = {
    "low.py": "from synth.kernels.compiled import kernel\nfrom synth.numbers import (\n    ADDED,\n)\n\n\n"
    "@kernel\ndef low(x):\n    return x + ADDED\n",
    "high.py": "from synth.kernels.compiled import kernel\nfrom synth import low as other\n\nlow = other.low\n\n\n"
    "@kernel\ndef high(x):\n    return 10.0 * low(x)\n",
    "apart.py": "from synth.kernels.compiled import kernel\n\n\n@kernel\ndef apart(x):\n    return -x\n",
    "numbers.py": "ADDED = 1.0\n",
}
RUN = (
    "from synth.high import high; from synth.low import low; from synth.apart import apart\n{middle}\n"
    "for each in (high, low, apart):\n    print(each(1.0), sum(each.stats.cache_hits.values()))"
)


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    """A package with three kernels and the project's own way to compile them."""
    (tmp_path / "synth").mkdir()
    kernels = Path(cache.__file__).parent
    (tmp_path / "synth/kernels").mkdir()
    for name in ("__init__", "cache", "compiled"):
        (tmp_path / f"synth/kernels/{name}.py").write_text((kernels / f"{name}.py").read_text())
    for name, text in MODULES.items():
        (tmp_path / "synth" / name).write_text(text)
    return tmp_path


def begun(folder: Path, middle: str = "") -> subprocess.Popen[str]:
    """A process that calls each kernel, and tells its value and whether it came from the cache."""
    given = {**os.environ, "PYTHONPATH": str(folder), "XDG_CACHE_HOME": str(folder / "cache")}
    given |= {"ISOCHRONY_CACHE": "", "PYTHONDONTWRITEBYTECODE": "1"}  # bytecode knows edits by the second
    code = [sys.executable, "-c", RUN.format(middle=middle)]
    return subprocess.Popen(code, cwd=folder, env=given, stdout=subprocess.PIPE, text=True)


def ran(folder: Path, middle: str = "") -> list[str]:
    """What such a process told."""
    told = begun(folder, middle).communicate()[0]
    return told.splitlines()


@pytest.mark.compiled
def test_an_edit_recompiles_what_depends_on_it_and_nothing_else(tiny: Path) -> None:
    assert ran(tiny) == ["20.0 0", "2.0 0", "-1.0 0"]
    assert ran(tiny) == ["20.0 1", "2.0 1", "-1.0 1"]
    (tiny / "synth/numbers.py").write_text("ADDED = 2.0\n")
    assert ran(tiny) == ["30.0 0", "3.0 0", "-1.0 1"]
    high = tiny / "synth/high.py"
    high.write_text("# a line more\n" + high.read_text().replace("10.0", "100.0"))
    assert ran(tiny) == ["300.0 0", "3.0 1", "-1.0 1"]
    (tiny / "synth/numbers.py").write_text("ADDED = 1.0\n")
    assert ran(tiny)[1:] == ["2.0 1", "-1.0 1"]


@pytest.mark.compiled
def test_what_a_process_compiles_after_an_edit_is_nobody_elses(tiny: Path) -> None:
    """It has loaded what the file held before."""
    edit = f"open({str(tiny / 'synth/numbers.py')!r}, 'w').write('ADDED = 2.0')"
    assert ran(tiny, middle=edit) == ["20.0 0", "2.0 0", "-1.0 0"]
    assert ran(tiny) == ["30.0 0", "3.0 0", "-1.0 1"]


@pytest.mark.compiled
def test_of_processes_that_begin_together_one_compiles(tiny: Path) -> None:
    together = [begun(tiny) for _ in range(3)]
    told = [line for each in together for line in each.communicate()[0].splitlines()]
    for value in ("20.0", "2.0", "-1.0"):
        assert sorted(line for line in told if line.startswith(f"{value} ")) == [f"{value} 0", *[f"{value} 1"] * 2]


@pytest.mark.compiled
def test_a_slice_that_does_not_fit_is_refused_as_by_numba_itself() -> None:
    def assign(values: Any, to: Any) -> None:
        to[1:] = values

    to = np.zeros(4)
    made = compiled.making_kernel(assign)
    made(np.ones(3), to)
    assert np.array_equal(to, [0.0, 1.0, 1.0, 1.0])
    with pytest.raises(ValueError, match="slice from an array of another shape"):
        made(np.ones(5), to)
    with pytest.raises(ValueError, match="of shape"):  # other code of the process is let be
        numba.njit(assign)(np.ones(5), to)


@pytest.mark.compiled
@pytest.mark.parametrize("counts", [True, False])
def test_arrays_go_only_between_kernels_that_both_count_references_or_both_do_not(counts: bool) -> None:
    """A caller that counts would free what it was given by one that does not; the other way it would never be freed."""
    ways = compiled.making_kernel, compiled.kernel
    inner = ways[counts](lambda values: values)

    def outer(values: Any) -> float:
        return float(inner(values)[0])

    with pytest.raises(Exception, match="returns arrays: it and who calls it count references, or neither"):
        ways[not counts](outer)(np.ones(2))
    assert ways[counts](outer)(np.ones(2)) == 1.0


def branching(values: Any, turns: int) -> float:
    """Too large to be taken in by its callers, with an argument, the array's parent, that it makes no use of."""
    total = 0.0
    for k in range(values.size):
        x, y = values[k], 0.0
        for _ in range(turns):
            y += math.sin(x) if x > 1.0 else math.cos(x)
            y += math.exp(-x) if y > 1.0 else math.sqrt(1.0 + x * x)
        for n in range(turns):
            y += math.sin(x + n) if x > 1.0 else math.cos(x - n)
            y += math.exp(-x * n) if y > 1.0 else math.sqrt(n + x * x)
        for n in range(turns):
            y += math.atan(x + n) if x > 1.0 else math.tanh(x - n)
            y += math.exp(-x / (1 + n)) if y > 1.0 else math.sqrt(n + x * x)
        total += y
    return total


@pytest.mark.compiled
def test_code_of_others_calls_a_part_as_it_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a kernel makes of its part, without arguments that are not used, has another name."""
    monkeypatch.setattr(compiled, "cache_folder", lambda: tmp_path)
    part, values = compiled.kernel(branching), np.arange(3.0)

    def twice(values: Any) -> float:
        return part(values, 1) + part(values, 2)

    def other(values: Any) -> float:
        return part(values, 3)

    assert compiled.kernel(twice)(values) == pytest.approx(branching(values, 1) + branching(values, 2))
    assert numba.njit(other)(values) == pytest.approx(branching(values, 3))


SCALAR = {"np.sqrt", "np.rint", "np.hypot", "np.log", "np.sin", "np.cos", "np.isfinite"}
"""What of NumPy kernels call that make no arrays: what returns one would never free it there."""


def test_kernels_that_count_no_references_make_no_arrays() -> None:
    for path in [*(cache.ROOT / "synth").rglob("*.py"), *(cache.ROOT / "pipeline").rglob("*.py")]:
        for each in ast.walk(ast.parse(path.read_text())):
            ways = {ast.unparse(way) for way in getattr(each, "decorator_list", ())}
            if ways & {"kernel", "summing_kernel"}:
                called = {ast.unparse(call.func) for call in ast.walk(each) if isinstance(call, ast.Call)}
                assert {name for name in called if name.startswith("np.")} <= SCALAR, f"{path}: {each.name}"


def test_a_kernel_through_the_registry_is_made_from_all_that_is_registered() -> None:
    found = cache.closure([cache.ROOT / "synth/systems/dispatch.py"])
    assert {cache.ROOT / f"synth/systems/{name}.py" for name in ("resistance", "yielding", "terms")} <= set(found)


def test_kernels_of_the_joint_fit_are_made_from_few_files() -> None:
    found = cache.closure([cache.ROOT / "pipeline/joint/filtering.py"])
    assert cache.ROOT / "pipeline/joint/remainder.py" in found
    assert len(found) < 20
