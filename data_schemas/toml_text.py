"""Writes plain values as TOML, which the standard library only reads."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def toml_text(content: Mapping[str, Any]) -> str:
    """A mapping of text, numbers, truth values, flat lists, tables and lists of tables as TOML.

    What is None is left out. Reading it back gives the same values.

    Examples
    --------
    >>> print(toml_text({"a": 1.0, "b": None, "c": [{"d": "e", "f": {"1": 1.0, "2": -1.0}}], "g": {"h": True}}), end="")
    a = 1.0
    <BLANKLINE>
    [[c]]
    d = "e"
    f = { "1" = 1.0, "2" = -1.0 }
    <BLANKLINE>
    [g]
    h = true
    """
    lines, tables = [], []
    for name, value in content.items():
        if isinstance(value, Mapping):
            tables += ["", f"[{_key(name)}]", *_pairs(value)]
        elif isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
            for each in value:
                tables += ["", f"[[{_key(name)}]]", *_pairs(each)]
        elif value is not None:
            lines.append(f"{_key(name)} = {_value(value)}")
    return "\n".join(lines + tables) + "\n"


def _pairs(table: Mapping[str, Any]) -> list[str]:
    return [f"{_key(name)} = {_value(value)}" for name, value in table.items() if value is not None]


def _key(name: str) -> str:
    bare = name.isascii() and name.replace("_", "").replace("-", "").isalpha()
    return name if bare else _text(name)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_pairs(value)) + " }" if value else "{}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(each) for each in value) + "]"
    return repr(value)


def _text(text: str) -> str:
    """A basic string: JSON's escapes are TOML's, but for the delete character."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")
