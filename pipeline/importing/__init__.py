"""Text tables of times and angles become records."""

from __future__ import annotations

import importlib
from typing import Any

_WHERE = {"ImportOptions": "pipeline.importing.pendulums", "import_csv": "pipeline.importing.record"}
__all__ = ["ImportOptions", "import_csv"]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'pipeline.importing' has no attribute '{name}'")
    return getattr(importlib.import_module(_WHERE[name]), name)


def __dir__() -> list[str]:
    return sorted(_WHERE)
