"""A suite's tables as one JSON file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def write(path: Path, tables: Mapping[str, Any]) -> None:
    """Write tables by name; not-a-number becomes null."""
    path.write_text(json.dumps(finite(tables), indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


def finite(value: Any) -> Any:
    """A nest of mappings and sequences without the numbers that JSON has no word for.

    >>> finite({"ms": float("nan"), "pass": (True, 2.0)})
    {'ms': None, 'pass': [True, 2.0]}
    """
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
