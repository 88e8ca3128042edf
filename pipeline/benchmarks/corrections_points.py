"""What a record may be: a nominal record of real pendulums, and the factors by which others depart from it.

The nominal record is noise-free, so that what a method leaves is its own: arcs of 10 to 16 mrad, a swell that moves the
pendulums by three times the difference's arc, heave that is recorded, a little vibration near the pendulums' period.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from data_schemas.scene import Scene
from pipeline.benchmarks.scenes import Motion, resonant, swell, two_pendulums

FULL_LENGTH, QUICK_LENGTH = 1800.0, 600.0  # s
_DAMPING = 1e-4  # s-1, of the second pendulum
_PHASES = (0.4, 2.2)  # rad, of the first pendulum and of the difference: no beat passes through zero
_HEAVE = (0.05, 9.0)  # m s-2, s
_SHORTEST = 6.0  # s, peak period of the lowest sea; a second longer for each metre
_HEIGHT = 3.0  # m, of the sea that is met at depth
_SAMPLINGS: dict[str, dict[str, Any]] = {
    "25 Hz": {"sampling_rate": 25},
    "10 Hz": {"sampling_rate": 10},
    "8 Hz": {"sampling_rate": 8},
}


@dataclass(frozen=True)
class Point:
    """One record of the grids.

    Attributes
    ----------
    difference : float
        (n1 - n2)/n2.
    arc, first_arc, slow : float
        a of the difference and Theta1 of the first pendulum at the start; largest slow elongation psi; rad.
    strength, detuning : float
        Of the near-resonant vibration: share of gravity; rad s-1.
    height, depth : float or None, float
        Significant height of a sea in place of the swell and its heave, and the vessel's depth; m.
    damping_difference : float
        gamma1 - gamma2, s-1.
    states_damping : bool
        Whether the record states both rates.
    noise : float
        rad.
    length : float
        s.
    sampling : str
        "25 Hz", "10 Hz" or "8 Hz".
    """

    difference: float = 1e-4
    arc: float = 0.01
    first_arc: float = 0.01
    slow: float = 0.03
    strength: float = 1e-5
    detuning: float = 0.026
    height: float | None = None
    depth: float = 0.0
    damping_difference: float = 2e-5
    states_damping: bool = True
    noise: float = 0.0
    length: float = FULL_LENGTH
    sampling: str = "25 Hz"


@dataclass(frozen=True)
class Factor:
    """What is changed of the nominal record while all else stays.

    Attributes
    ----------
    name, unit : str
    values, quick : tuple
        All values; those of a quick run.
    at : callable
        The nominal point and a value give the point.
    """

    name: str
    unit: str
    values: tuple[Any, ...]
    quick: tuple[Any, ...]
    at: Callable[[Point, Any], Point]

    def chosen(self, *, quick: bool) -> tuple[Any, ...]:
        """Values of a run."""
        return self.quick if quick else self.values


def _set(field: str) -> Callable[[Point, Any], Point]:
    def at(point: Point, value: Any) -> Point:
        changed: dict[str, Any] = {field: value}
        return replace(point, **changed)

    return at


DIFFERENCE = Factor(
    "period difference",
    "1",
    (1e-7, 3e-7, 1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3),
    (1e-7, 1e-6, 1e-5, 1e-4, 1e-3),
    _set("difference"),
)
SLOW = Factor(
    "psi/a",
    "1",
    (0.0, 0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0),
    (0.0, 0.3, 1.0, 3.0, 10.0),
    lambda point, value: replace(point, slow=value * point.arc),
)
FACTORS = (
    DIFFERENCE,
    SLOW,
    Factor(
        "near-resonant strength",
        "share of g",
        (0.0, 1e-6, 1e-5, 4e-5, 1e-4),
        (0.0, 1e-6, 1e-5, 1e-4),
        _set("strength"),
    ),
    Factor(
        "near-resonant detuning",
        "rad/s",
        (0.003, 0.01, 0.026, 0.1, 0.3),
        (0.003, 0.026, 0.3),
        _set("detuning"),
    ),
    Factor(
        "Theta1/a",
        "1",
        (0.5, 1.0, 2.0, 3.0, 5.0, 10.0),
        (0.5, 1.0, 3.0, 10.0),
        lambda point, value: replace(point, first_arc=value * point.arc),
    ),
    Factor(
        "arc a",
        "mrad",
        (1.0, 2.0, 5.0, 10.0, 20.0, 50.0),
        (1.0, 5.0, 10.0, 50.0),
        lambda point, value: replace(point, arc=1e-3 * value, first_arc=1e-3 * value),
    ),
    Factor(
        "sea at the surface",
        "m high",
        (0.0, 0.5, 1.25, 2.5, 4.0, 6.0),
        (0.0, 1.25, 2.5, 6.0),
        lambda point, value: replace(point, height=value, depth=0.0),
    ),
    Factor(
        "depth below a 3 m sea",
        "m",
        (0.0, 5.0, 10.0, 20.0, 30.0, 50.0),
        (0.0, 10.0, 30.0),
        lambda point, value: replace(point, height=_HEIGHT, depth=value),
    ),
    Factor(
        "damping difference",
        "1/s",
        (0.0, 1e-6, 1e-5, 3e-5, 1e-4),
        (0.0, 1e-5, 1e-4),
        _set("damping_difference"),
    ),
    Factor(
        "damping difference, not stated",
        "1/s",
        (0.0, 1e-6, 1e-5, 3e-5, 1e-4),
        (0.0, 1e-5, 1e-4),
        lambda point, value: replace(point, damping_difference=value, states_damping=False),
    ),
    Factor("noise", "rad", (0.0, 1e-6, 1e-5, 1e-4, 1e-3), (0.0, 1e-5, 1e-4, 1e-3), _set("noise")),
    Factor("record length", "s", (300.0, 600.0, 1800.0, 3600.0, 7200.0), (300.0, 600.0, 1800.0), _set("length")),
    Factor("sampling", "", tuple(_SAMPLINGS), tuple(_SAMPLINGS), _set("sampling")),
)
"""Every factor of the one-at-a-time sweeps; the first two span the map."""
MAP = f"{DIFFERENCE.name} x {SLOW.name}"


@dataclass(frozen=True)
class Place:
    """A point and where it stands in the grids: the factor's name and its value, two values in the map."""

    factor: str
    value: Any
    unit: str
    point: Point


def places(*, quick: bool) -> Iterator[Place]:
    """Every record of the grids: sweeps of one factor at a time, then the map over the first two."""
    nominal = Point(length=QUICK_LENGTH if quick else FULL_LENGTH)
    for factor in FACTORS:
        for value in factor.chosen(quick=quick):
            yield Place(factor.name, value, factor.unit, factor.at(nominal, value))
    for difference in DIFFERENCE.chosen(quick=quick):
        for slow in SLOW.chosen(quick=quick):
            point = SLOW.at(DIFFERENCE.at(nominal, difference), slow)
            yield Place(MAP, (difference, slow), "1", point)


def scene(point: Point) -> Scene:
    """The scene of a point.

    The second pendulum's harmonic is the first's less the difference's, so that both arcs are what the point says.
    """
    first = cmath.rect(point.first_arc, _PHASES[0])
    second = first - cmath.rect(point.arc, _PHASES[1])
    recording = dict(_SAMPLINGS[point.sampling])
    if not point.states_damping:
        recording["write_damping"] = False
    return two_pendulums(
        "grid",
        point.difference,
        motion=_motion(point),
        amplitudes=(abs(first), abs(second)),
        phases=(cmath.phase(first), cmath.phase(second)),
        damping_rates=(_DAMPING + point.damping_difference, _DAMPING),
        duration=point.length,
        restoring="sine",
        seed=1958,
        noise=point.noise,
        vertical_acceleration=True,
        **recording,
    )


def _motion(point: Point) -> Motion:
    terms: Motion = []
    if point.height:
        # higher seas are longer; waves of a few seconds do not move a hull, and pairs of them would meet the swing
        sea = {
            "kind": "sea", "significant_height": point.height, "peak_period": _SHORTEST + point.height,
            "depth": point.depth, "cutoff": 2.5, "components": 48, "seed": 7,
        }  # fmt: skip
        terms += [sea, sea | {"axis": "vertical"}]
    elif point.height is None:
        heave = {"kind": "harmonics", "amplitude": [_HEAVE[0]], "period": [_HEAVE[1]], "axis": "vertical"}
        terms += [swell(point.slow), heave] if point.slow else [heave]
    if point.strength:
        terms.append(resonant(point.strength, point.detuning))
    return terms
