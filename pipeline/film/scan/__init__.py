"""Images of films, opened: any common file, any way round, one strip or several, read piece by piece."""

from __future__ import annotations

import importlib
from typing import Any

_WHERE = {
    "OpenScan": "pipeline.film.scan.opening",
    "ScanOptions": "pipeline.film.scan.opening",
    "open_scan": "pipeline.film.scan.opening",
}
__all__ = ["OpenScan", "ScanOptions", "open_scan"]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'pipeline.film.scan' has no attribute '{name}'")
    return getattr(importlib.import_module(_WHERE[name]), name)


def __dir__() -> list[str]:
    return sorted(_WHERE)
