"""`isochrony simulate --explain`: what would be computed, how and why, for a person or a program."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from pipeline.cli.tables import print_json

if TYPE_CHECKING:
    from data_schemas.scene import Scene


def print_explanation(scene: Scene, *, as_json: bool) -> None:
    """Print terms, propagator, why and expected error; nothing is simulated or written."""
    from dataclasses import asdict

    from synth.explanation import explain

    told = explain(scene)
    if as_json:
        print_json({"record_id": scene.record_id, "title": scene.title, **asdict(told)})
        return
    wanted = "none: as exact as the propagator can" if told.tolerance is None else power(told.tolerance)
    print(f"{scene.record_id}: {scene.title}" if scene.title else scene.record_id)
    _print_block("scene", {"pendulums": told.pendulums, "readings": told.readings})
    _print_block("terms", told.terms | {"left out": ", ".join(told.left_out) or "nothing"})
    _print_block(
        "propagator",
        {
            "chosen": told.propagator,
            "why": told.why,
            **({"if it refuses": ", then ".join(told.instead)} if told.instead else {}),
            "tolerance": wanted,
            "expected error": f"{power(told.expected_error)} of the largest angle",
        },
    )


def _print_block(heading: str, entries: Mapping[str, str]) -> None:
    print(f"\n{heading}")
    for name, words in entries.items():
        print(f"  {name:<19}{words}")


def power(value: float) -> str:
    """Show an error by its size.

    >>> power(1e-13), power(2.5e-7)
    ('1e-13', '2.5e-07')
    """
    exponent = math.floor(math.log10(value) + 1e-9)
    return f"1e{exponent:d}" if math.isclose(value, 10.0**exponent) else f"{value:.2g}"
