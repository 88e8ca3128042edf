"""What is passed and stored: scenes, records, truths, results; reading, writing and checking them."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .adopting import adopted as adopted
    from .checking import check as check
    from .checking import validate as validate
    from .checksum import content_sha256 as content_sha256
    from .json_schema import json_schema as json_schema
    from .layouts import VERSION as VERSION
    from .reading import read as read
    from .scene import load_scene as load_scene
    from .writing import write as write

_HOME = {
    "VERSION": "layouts", "adopted": "adopting", "check": "checking", "content_sha256": "checksum",
    "json_schema": "json_schema", "load_scene": "scene", "read": "reading", "validate": "checking", "write": "writing",
}  # fmt: skip

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
