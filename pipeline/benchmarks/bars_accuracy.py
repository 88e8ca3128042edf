"""Bars on single noise-free records."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from data_schemas.scene import Scene
from pipeline.benchmarks.bar import Row, at_most, holds
from pipeline.benchmarks.paper import marks_error, plain_error
from pipeline.benchmarks.scenes import beats_through_zero, linear
from pipeline.benchmarks.trials import outcome, prepared, reduce_all
from pipeline.reduction import reduce_by
from pipeline.validity import neglected_terms

SILENT: Mapping[str, Any] = {"write_restoring": False, "write_damping": False}
"""A record that states neither its restoring law nor its damping."""


def rows() -> Iterator[Row]:
    """Yield the bars of accuracy."""
    yield from _linear()
    yield from _wrong_by_nature()
    yield from _through_zero()


def undamped(**changes: Any) -> Scene:
    """Linear pendulums without damping, whose record says nothing."""
    return linear(damping_rates=(0.0, 0.0), **SILENT, **changes)


def _linear() -> Iterator[Row]:
    limits = {"projection": 1e-3, "complex": 1e-2, "panteleev": 1e-2}
    for words, scene in (("all stated", linear()), ("nothing stated", undamped())):
        found = reduce_all(scene, tuple(limits))
        for name, limit in limits.items():
            yield at_most(f"linear, {words}: {name}", abs(found[name].error), limit, "mGal")


def _wrong_by_nature() -> Iterator[Row]:
    """Methods that are wrong must be wrong by what physics says, within 1 %."""
    scene = linear()
    found = reduce_all(scene, ("vening-meinesz", "uncorrected"))
    for name, expected, source in (
        ("vening-meinesz", marks_error(scene), "(14) on truth"),
        ("uncorrected", plain_error(scene), "the true phase's slope"),
    ):
        off = abs(found[name].error / expected - 1.0)
        yield at_most(f"linear: {name} {found[name].error:.4g} mGal, off {source} {expected:.4g} by", off, 0.01)
    ready = prepared(undamped())
    error = outcome(reduce_by("general", ready, 0.0), scene.gravity).error
    expected = -neglected_terms(ready)["finite_arc"]
    off = abs(error / expected - 1.0)
    yield at_most(f"linear, nothing stated: general {error:.4g} mGal, off its arc terms {expected:.4g} by", off, 0.01)


def _through_zero() -> Iterator[Row]:
    found = reduce_all(beats_through_zero(), ("projection", "complex", "panteleev"))
    yield at_most("beats through zero: projection", abs(found["projection"].error), 1e-2, "mGal")
    flagged = "beats-through-zero" in found["projection"].flags
    yield holds("beats through zero: projection carries the flag", flagged, "flag beats-through-zero")
    yield holds("beats through zero: panteleev declines", bool(found["panteleev"].refusal), "refused")
