"""Figures of records and results: matplotlib is imported only when one is drawn, and never opens a window."""

from __future__ import annotations

import importlib
from typing import Any

_WHERE = {
    "demo_figure": "pipeline.plots.result",
    "film_figure": "pipeline.plots.film",
    "period_figure": "pipeline.plots.period",
    "record_figure": "pipeline.plots.record",
    "result_figure": "pipeline.plots.result",
    "save": "pipeline.plots.canvas",
    "unread_figure": "pipeline.plots.film",
    "synchrony_figure": "pipeline.plots.synchrony",
}
__all__ = [
    "demo_figure",
    "film_figure",
    "period_figure",
    "record_figure",
    "result_figure",
    "save",
    "synchrony_figure",
    "unread_figure",
]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'pipeline.plots' has no attribute '{name}'")
    return getattr(importlib.import_module(_WHERE[name]), name)


def __dir__() -> list[str]:
    return sorted(_WHERE)
