"""The mutator changes what can matter and nothing else, draws by its seed, and tells the killed from the others."""

from __future__ import annotations

import ast
import json
import os
from pathlib import Path

import pytest

from tests.mutation.__main__ import known
from tests.mutation.mutants import Mutant, mutants, sample
from tests.mutation.parts import PARTS, Part
from tests.mutation.running import KILLED, ROOT, SURVIVED, TIMED_OUT, Scratch, confine

SILENT = '''"""Says 1 + 1."""
from typing import TYPE_CHECKING
if TYPE_CHECKING:
    from a import b
__all__ = ["f"] + ["g"]
Text = str | bytes
def f(x: int | None = None) -> int | None:
    """Is 2 + 2."""
    assert x is not None
    why = "one" if x else f"two {x + 1}"
    raise ValueError(why + "three", 3)
'''
MODULE = """def size(values, most):
    total = 0
    while values:
        total += values.pop()
    if total > most:
        raise ValueError(total)
    return total

def alone():
    return 7
"""
TESTS = """import pytest
from tiny.module import size

def test_sums():
    assert size([1, 2], 9) == 3

def test_is_bounded():
    with pytest.raises(ValueError):
        size([9], 3)
"""


def made(source: str) -> dict[str, Mutant]:
    """Mutants by the text that each puts in, of a module in one line."""
    return {one.applied(source.encode()).decode(): one for one in mutants("a.py", source.encode())}


@pytest.mark.parametrize(
    ("source", "changed"),
    [
        ("x < y", {"(x <= y)", "(x >= y)"}),
        ("x and y", {"(x or y)"}),
        ("x - y[1:]", {"(x + y[1:])", "x - y[(2):]", "x - y[(0):]", "x - y[:]"}),
        ("x if y else z", {"x if (not (y)) else z"}),
        ("f(0.5)", {"pass", "f((1.0))", "f((0.25))"}),
        ("min(-x)", {"pass", "(max)(-x)", "min((x))"}),
        ("x += y", {"x -= y", "pass"}),
        ("x.y = True", {"pass", "x.y = (False)"}),
        ("def f(): return x", {"def f(): return None"}),
        ("while x: break", {"while (not (x)): break", "while x: pass"}),
    ],
)
def test_what_is_changed(source: str, changed: set[str]) -> None:
    assert set(made(source)) == changed


def test_what_cannot_matter_is_left_alone() -> None:
    (one,) = made(SILENT)  # that it is raised at all matters
    assert one == SILENT.replace('raise ValueError(why + "three", 3)', "pass")


@pytest.mark.parametrize("name", PARTS)
def test_every_part_has_mutants_that_compile(name: str) -> None:
    paths = [str(one.relative_to(ROOT)) for pattern in PARTS[name].files for one in sorted(ROOT.glob(pattern))]
    drawn = sample(ROOT, paths, 1, 60)
    assert len({(one.path, one.begin, one.end) for one in drawn}) == 60
    for one in drawn:
        source = (ROOT / one.path).read_bytes()
        assert ast.dump(ast.parse(one.applied(source))) != ast.dump(ast.parse(source))
        assert one.path in one.shown(source)
    assert all(any(ROOT.glob(pattern)) for pattern in PARTS[name].tests)


def test_the_draw_follows_the_seed_and_outlives_edits(tmp_path: Path) -> None:
    path = tmp_path / "module.py"
    path.write_text(MODULE)
    before = [one.identity for one in sample(tmp_path, ["module.py"], 1, 5)]
    assert before != [one.identity for one in sample(tmp_path, ["module.py"], 2, 5)]
    path.write_text(f"import os\n\n{MODULE}")
    assert before == [one.identity for one in sample(tmp_path, ["module.py"], 1, 5)]


def test_outcomes_of_a_small_repository(tmp_path: Path) -> None:
    for place, text in {
        "tiny/module.py": MODULE,
        "tests/test_module.py": TESTS,
        "pyproject.toml": '[tool.coverage.run]\nsource = ["tiny"]\n[tool.pytest.ini_options]\npythonpath = ["."]\n'
        'markers = ["campaign", "compiled"]\n',
    }.items():
        (tmp_path / "root" / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "root" / place).write_text(text)
    part = Part(("tiny/*.py",), ("tests/test_*.py",))
    scratch = Scratch(tmp_path / "scratch", part, tmp_path / "root", least=10.0)
    scratch.survey()
    found = {}
    for one in mutants("tiny/module.py", MODULE.encode()):
        if one.text in ("total -= values.pop()", "(total >= most)", "pass", "(8)", "return None", "(not (values))"):
            found[f"{one.line} {one.text}"] = scratch.try_out(one)[0]
    assert found == {
        "3 (not (values))": KILLED,
        "4 total -= values.pop()": KILLED,
        "4 pass": TIMED_OUT,
        "5 (total >= most)": SURVIVED,
        "6 pass": KILLED,
        "7 return None": KILLED,
        "10 return None": SURVIVED,  # nobody calls it
        "10 (8)": SURVIVED,
    }
    assert (scratch.folder / "tiny/module.py").read_text() == MODULE


def test_nothing_outside_its_folder_is_changed(tmp_path: Path) -> None:
    """A mutant of the writer, run by root, would replace devices."""
    (tmp_path / "inside").mkdir()
    (tmp_path / "outside").write_text("precious")
    child = os.fork()
    if child == 0:
        try:
            confine(tmp_path / "inside")
            (tmp_path / "inside/file").write_text("mine")
            os.rename(tmp_path / "inside/file", tmp_path / "outside")
        except PermissionError:
            os._exit(0)
        finally:
            os._exit(1)
    assert os.waitpid(child, 0)[1] == 0
    assert (tmp_path / "outside").read_text() == "precious"


def test_the_last_line_of_a_mutant_counts(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    assert known(path) == {}
    path.write_text("".join(json.dumps({"identity": "a", "outcome": one}) + "\n" for one in (SURVIVED, KILLED)))
    assert known(path) == {"a": KILLED}
