"""Bars on single noise-free records, on the noisy record with gaps, and on what `auto` chooses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from data_schemas.scene import Scene
from pipeline.benchmarks.bar import Row, at_most, holds, reported
from pipeline.benchmarks.paper import marks_error, plain_error
from pipeline.benchmarks.scenes import beats_through_zero, linear, marks_only, noisy_gaps, uneven
from pipeline.benchmarks.trials import Outcome, campaign, outcome, prepared, reduce_all
from pipeline.reduction import reduce_by
from pipeline.validity import neglected_terms

SILENT: Mapping[str, Any] = {"write_restoring": False, "write_damping": False}
"""A record that states neither its restoring law nor its damping."""
GAP_SEEDS = 30


def rows() -> Iterator[Row]:
    """Yield the bars of accuracy."""
    yield from _linear()
    yield from _wrong_by_nature()
    yield from _through_zero()
    yield from _gaps()
    yield from _uneven()
    yield from _auto()


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


def _gaps() -> Iterator[Row]:
    for words, scene in (
        ("", noisy_gaps()),
        (", nothing stated", noisy_gaps(damping_rates=(0.0, 0.0), **SILENT)),
    ):
        found = campaign(scene, ("projection",), GAP_SEEDS)["projection"]
        yield at_most(f"noise and gaps{words}: projection, r.m.s. of {GAP_SEEDS}", found.rmse, 0.06, "mGal")
        worst = float(np.max(np.abs(found.errors)))
        yield at_most(f"noise and gaps{words}: projection, worst of {GAP_SEEDS}", worst, 0.15, "mGal")


def _uneven() -> Iterator[Row]:
    found = reduce_all(uneven(), ("projection", "auto", "complex", "panteleev"))
    for name in ("projection", "auto"):
        yield at_most(f"10 ms jitter, 20 % dropped: {name}", abs(found[name].error), 0.01, "mGal")
    for name in ("complex", "panteleev"):
        yield reported(f"10 ms jitter, 20 % dropped: {name}", abs(found[name].error), "mGal")


def _auto() -> Iterator[Row]:
    """`auto` beside the exact method, whether or not the record says what law its pendulums have."""
    kinds = {
        "linear": linear(),
        "linear, nothing stated": undamped(),
        "beats through zero": beats_through_zero(),
        "beats through zero, nothing stated": beats_through_zero(**SILENT),
        "noise and gaps": noisy_gaps(),
        "noise and gaps, nothing stated": noisy_gaps(damping_rates=(0.0, 0.0), **SILENT),
        "marks": marks_only(),
        "marks, nothing stated": marks_only(damping_rates=(0.0, 0.0), **SILENT),
    }
    for words, scene in kinds.items():
        # simulated with its noise: the scene's own seed
        found: dict[str, Outcome] = reduce_all(scene, ("auto", "projection"))
        apart = abs(found["auto"].error - found["projection"].error)
        yield at_most(f"{words}: auto beside projection", apart, 0.01, "mGal")
