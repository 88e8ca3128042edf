"""Argument parsing that answers every misuse with one line and the nearest known name."""

import argparse
import functools
import math
import os
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from data_schemas.errors import UsageError


@functools.cache
def page(name: str) -> dict[str, Any]:
    """What help says of a verb, and its options, from its file in `pages`."""
    return tomllib.loads((Path(__file__).parent / "pages" / f"{name}.toml").read_text(encoding="utf-8"))


class Parser(argparse.ArgumentParser):
    """An `argparse` parser that raises `UsageError` instead of printing its usage block and leaving."""

    def __init__(self, **settings: Any) -> None:
        formatter: Any = functools.partial(argparse.RawDescriptionHelpFormatter, max_help_position=30)
        super().__init__(allow_abbrev=False, formatter_class=formatter, **settings)

    def error(self, message: str) -> NoReturn:
        """Raise `UsageError` with the message and where to read on; never returns."""
        verb = self.prog.partition(" ")[2]
        where = f"{verb}: " if verb else ""
        raise UsageError(f"{where}{message}; see '{self.prog} --help'")

    def parse_strictly(self, arguments: list[str]) -> argparse.Namespace:
        """Parse options and positionals in any order; what is left over is named with its nearest option."""
        namespace, left = self.parse_known_intermixed_args(arguments)
        self.refuse(left)
        return namespace

    def refuse(self, left: list[str]) -> None:
        """Raise `UsageError` for words that no option or positional took, if there are any."""
        for word in left:
            if not word.startswith("-"):
                self.error(f"unexpected argument '{word}'")
            name = word.partition("=")[0]
            self.error(f"unknown option '{name}'{did_you_mean(name, self._option_string_actions)}")


def parser_of(verb: str, listed: str = "") -> Parser:
    """Parser of a verb, as its page has it; what is listed comes behind the description."""
    known = page(verb)
    parser = Parser(prog=f"isochrony {verb}", description=known["description"] + listed, epilog=known["examples"])
    _add(parser, known.get("options", {}))
    for title, rows in known.get("groups", {}).items():
        _add(parser.add_argument_group(title), rows)
    return parser


def _add(parser: Any, rows: Mapping[str, Any]) -> None:
    """Add options: each with the words of `argparse`, but for its type; or those that several verbs share."""
    for option, row in rows.items():
        if row == "shared":
            _add(parser, page("shared")[option])
            continue
        settings = dict(row)
        if "type" in row:
            kind, *limits = row["type"]
            settings["type"] = _TYPES[kind](option, *limits)
        parser.add_argument(option, **settings)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Tail of a sentence naming the nearest known name, or all of them when none is near.

    >>> did_you_mean("proces", ["process", "plot"])
    "; did you mean 'process'?"
    >>> did_you_mean("xyz", ["rad", "deg"])
    '; known: rad, deg'
    """
    import difflib

    names = list(known)
    near = difflib.get_close_matches(word, names, n=1)
    return f"; did you mean '{near[0]}'?" if near else f"; known: {', '.join(names)}"


def one_of(what: str, known: Iterable[str]) -> Callable[[str], str]:
    """Converter for `type=` that takes one of the known names and nothing else."""
    names = tuple(known)

    def convert(word: str) -> str:
        if word not in names:
            raise UsageError(f"unknown {what} '{word}'{did_you_mean(word, names)}")
        return word

    return convert


def number(option: str, above: float | None = None) -> Callable[[str], float]:
    """Converter for `type=` that takes a finite number greater than `above`, or of at least 0 without it."""
    limit = " of at least 0" if above is None else "" if above == -math.inf else f" greater than {above:g}"

    def convert(word: str) -> float:
        try:
            value = float(word)
        except ValueError:
            raise UsageError(f"{option} wants a number, not '{word}'") from None
        if not (math.isfinite(value) and (value >= 0.0 if above is None else value > above)):
            raise UsageError(f"{option} wants a finite number{limit}, not '{word}'")
        return value

    return convert


def whole_number(option: str, least: int = 0, most: int = 2**63 - 1) -> Callable[[str], int]:
    """Converter for `type=` that takes a whole number within limits; those of a seed by default."""
    limits = f"from {least} to {most if most < 2**63 - 1 else '2^63 - 1'}"

    def convert(word: str) -> int:
        if not (word.isascii() and word.isdigit() and len(word) < 20 and least <= int(word) <= most):
            raise UsageError(f"{option} wants a whole number {limits}, not '{word}'")
        return int(word)

    return convert


_TYPES: Mapping[str, Callable[..., Callable[[str], Any]]] = {
    "number": number,
    "whole number": whole_number,
    "one of": lambda _option, what, known: one_of(what, known.split()),
}


def periods(verb: str, texts: Iterable[str]) -> dict[str, float]:
    """Label -> seconds; the label "" where none was written."""
    labelled = pairs(verb, "--period", (text if "=" in text else f"={text}" for text in texts))
    return {label: number("--period", above=0.0)(value) for label, value in labelled.items()}


def pairs(verb: str, option: str, texts: Iterable[str]) -> dict[str, str]:
    """Name -> value; `UsageError` for no equals sign, no value, or a name twice.

    >>> pairs("import", "--combination", ["upper=1-2"])
    {'upper': '1-2'}
    """
    found: dict[str, str] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not equals or not value:
            raise UsageError(f"{verb}: {option} {text}: write it as {option} NAME=VALUE")
        if key in found:
            raise UsageError(f"{verb}: {option} names '{key}' twice; give each once")
        found[key] = value
    return found


def processors() -> int:
    """Processors of this process; all of the machine where the system cannot tell."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
