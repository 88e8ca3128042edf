"""The reading table: a page on this machine at which a person corrects the reading of a film."""

from __future__ import annotations

from pipeline.film.table.server import Session, serve

__all__ = ["Session", "serve"]
