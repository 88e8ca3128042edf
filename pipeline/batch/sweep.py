"""A grid of values for keys of a scene."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

from data_schemas.errors import UsageError

MOST = 1_000_000
"""Points of a grid."""

Variant = tuple[tuple[str, Any], ...]
"""One point: keys of the scene by dotted path, each with its value."""


def parse_sweep(word: str) -> tuple[str, list[Any]]:
    """A key and its values from ``KEY=A,B,C`` or ``KEY=LOW:HIGH:COUNT`` (evenly spaced, both ends included).

    `UsageError` for neither form, or no number where one must be.

    Examples
    --------
    >>> parse_sweep("gravity=9.7:9.9:3")
    ('gravity', [9.7, 9.8, 9.9])
    >>> parse_sweep("recording.sampling_rate=10,25")
    ('recording.sampling_rate', [10, 25])
    """
    key, given, text = word.partition("=")
    values = _values(text) if key and given else None
    if not values:
        raise UsageError(f"--sweep wants KEY=A,B,C or KEY=LOW:HIGH:COUNT, such as gravity=9.7:9.9:5, not '{word}'")
    return key, values


def grid(sweeps: Sequence[tuple[str, list[Any]]]) -> list[Variant]:
    """All points, the last key changing fastest; one empty point without any sweep.

    `UsageError` for a key twice, or too many points.

    Examples
    --------
    >>> grid([("a", [1, 2]), ("b", [3])])
    [(('a', 1), ('b', 3)), (('a', 2), ('b', 3))]
    """
    keys = [key for key, _ in sweeps]
    if len(set(keys)) < len(keys):
        raise UsageError("--sweep names a key twice; name each once")
    if math.prod(len(values) for _, values in sweeps) > MOST:
        raise UsageError(f"--sweep makes more than {MOST} points; make the grid smaller")
    return [tuple(zip(keys, point, strict=True)) for point in itertools.product(*(values for _, values in sweeps))]


def _values(text: str) -> list[Any] | None:
    ends = text.split(":")
    if len(ends) == 1:
        return [_value(word) for word in text.split(",")] if text else None
    try:
        low, high, count = float(ends[0]), float(ends[1]), int(ends[2])
    except (ValueError, IndexError):
        return None
    if len(ends) > 3 or not (math.isfinite(low) and math.isfinite(high) and 2 <= count <= MOST):
        return None
    # rounded in the fifteenth digit, as a person would write them
    return [float(f"{low + (high - low) * step / (count - 1):.15g}") for step in range(count)]


def _value(word: str) -> Any:
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return word
