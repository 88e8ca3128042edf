"""Records in, gravity out: the difference pendulum, its phase, the corrections, the uncertainty; synchrony."""

import importlib
from typing import Any

_WHERE = {
    "METHODS": "pipeline.methods",
    "digitise": "pipeline.film.digitise",
    "process": "pipeline.processing",
    "register_correction": "pipeline.ledger.book",
    "register_method": "pipeline.methods",
    "summaries": "pipeline.summary",
    "synchrony": "pipeline.synchronism.recipe",
    "observe": "pipeline.observation",
    "Observation": "pipeline.observation",
}
__all__ = sorted(_WHERE)


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'pipeline' has no attribute '{name}'")
    found = getattr(importlib.import_module(_WHERE[name]), name)
    if name == "process":
        importlib.import_module("pipeline.summary")  # for `result.isochrony`; xarray is loaded by now
    return found


def __dir__() -> list[str]:
    return sorted(_WHERE)
