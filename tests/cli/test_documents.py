"""Commands that the documents show are commands that there are: verb, options and values parse as they stand."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from pipeline.cli import main as entry
from pipeline.cli.parser import Parser

ROOT = Path(__file__).parents[2]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def commands() -> list[str]:
    """Each command of an indented or fenced block, without what is said of it."""
    found = []
    for document in DOCUMENTS:
        for line in document.read_text().splitlines():
            if line.strip().startswith(("isochrony ", "$ isochrony ")):
                command = re.split(r"\s{2,}|\s#\s", line.strip().removeprefix("$ "))[0]
                found += [part.strip() for part in command.split("&&") if part.strip().startswith("isochrony ")]
    return list(dict.fromkeys(found))


def test_there_are_commands() -> None:
    assert len(commands()) > 30


@pytest.mark.parametrize("command", commands())
def test_a_command_parses(command: str) -> None:
    verb, *words = [word for word in shlex.split(command)[1:] if word not in ("...", "|", "VERB")]
    if verb.startswith("-"):
        return
    parser = Parser(prog=f"isochrony {verb}")
    entry._VERBS[verb].add_options(parser)
    if "--help" not in words:
        parser.parse_strictly(words)
