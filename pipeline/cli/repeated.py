"""Options of the form NAME=VALUE that may be repeated."""

from __future__ import annotations

from collections.abc import Iterable

from data_schemas.errors import UsageError
from pipeline.cli.parser import number


def periods(verb: str, texts: Iterable[str]) -> dict[str, float]:
    """Label -> seconds; the label "" where none was written."""
    labelled = pairs(verb, "--period", (text if "=" in text else f"={text}" for text in texts))
    return {label: number("--period", above=0.0)(value) for label, value in labelled.items()}


def pairs(verb: str, option: str, texts: Iterable[str]) -> dict[str, str]:
    """Name -> value.

    Raises
    ------
    UsageError
        No equals sign, no value, or a name twice.

    Examples
    --------
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
