"""What would be computed, how and why, without computing it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from data_schemas.scene import Scene
from data_schemas.scene_fields import Section, extra
from data_schemas.scene_pendulum import (
    RESISTANCES,
    BeamSupport,
    BoardSupport,
    FrameSupport,
    ImpulseEscapement,
    Pendulum,
    VanDerPolEscapement,
)
from synth.choice import NAMES, expected_error, listed
from synth.plan import Plan, plan
from synth.recording.clock import Clock, set_clock

_TERMS = (
    "restoring", *RESISTANCES.values(), "escapement", "yielding support",
    "horizontal motion", "vertical motion", "random kicks", "changing gravity",
    "tide", "tilting case", "planes of swing", "handling",
)  # fmt: skip
_MOST_PERIODS = 4


@dataclass(frozen=True)
class Explanation:
    """A scene's way through the simulator."""

    pendulums: str
    """How many, and their periods."""
    terms: dict[str, str]
    """Terms of the equations of motion, each in words with its numbers."""
    left_out: tuple[str, ...]
    """Terms that the scene does not name: no code is compiled or run for them."""
    readings: str
    """How many, and when."""
    propagator: str
    """As the truth calls it."""
    why: str
    """In one line."""
    instead: tuple[str, ...]
    """Who would stand in for it, should it refuse."""
    tolerance: float | None
    """Error that the scene asks for."""
    expected_error: float
    """Of the largest angle."""


def explain(scene: Scene) -> Explanation:
    """Say which terms a scene has, who would integrate them, why, and how exactly.

    `SceneError` if the scene cannot be simulated.

    Examples
    --------
    >>> from data_schemas.scene import load_scene
    >>> from synth.shipped import scene_path
    >>> told = explain(load_scene(scene_path("linear")))
    >>> told.propagator, told.expected_error
    ('closed form', 1e-15)
    >>> told.terms["horizontal motion"]
    '65 harmonics: sea and near-resonant'
    """
    clock = set_clock(scene)
    made = plan(scene, clock)
    terms = dict(_terms(scene, made))
    choice = made.choice
    return Explanation(
        _periods(scene.pendulums),
        terms,
        tuple(name for name in _TERMS if name not in terms),
        _readings(scene, clock),
        made.propagator,
        choice.why,
        tuple(NAMES[name] for name in choice.instead),
        made.tolerance,
        expected_error(choice, made.tolerance),
    )


def _terms(scene: Scene, made: Plan) -> Iterator[tuple[str, str]]:
    pendulums = scene.pendulums
    yield "restoring", "the full sine" if scene.restoring == "sine" else "linear, for small arcs"
    said: dict[str, Callable[[Pendulum], Any]] = {
        name: partial(_resistance, field) for field, name in RESISTANCES.items()
    }
    for name, words in (said | {"escapement": _escapement}).items():
        found = _each(pendulums, words)
        if found:
            yield name, found
    if scene.support.kind != "fixed":
        yield "yielding support", _support(scene.support)
    for axis, motion in (("horizontal", made.motion), ("vertical", made.vertical)):
        kinds = dict.fromkeys(term.kind for term in scene.motion if term.axis == axis and term.kind != "still")
        if kinds:
            count = motion.angular_frequency.size
            of_what = "" if list(kinds) == ["harmonics"] else f": {listed(kinds)}"
            yield f"{axis} motion", f"{count} harmonic{'s' if count > 1 else ''}{of_what}"
    found = _each(pendulums, lambda each: each.kick_intensity and f"{each.kick_intensity:g} rad s-1/2")
    if found:
        yield "random kicks", found
    if scene.gravity_course is not None:
        yield "changing gravity", f"{scene.gravity_course.kind}, mean change {made.mean_change:.3g} m/s2"
    if scene.conditions.tide:
        yield "tide", "of a yielding Earth"
    if scene.case is not None:
        tilts = [name for name in ("pitch", "roll") if getattr(scene.case, name) is not None]
        yield "tilting case", f"{listed(tilts) or 'at rest'}, elongations from the {scene.case.reference}"
    found = _each(pendulums, lambda each: each.plane and f"{each.plane:g} rad off")
    if found:
        yield "planes of swing", found
    if scene.events:
        yield "handling", listed(f"{each.kind} of {each.pendulum} at {each.time:g} s" for each in scene.events)
    if made.caution is not None:
        yield "caution", made.caution


def _periods(pendulums: Sequence[Pendulum]) -> str:
    periods = [each.period for each in pendulums]
    if len(periods) > _MOST_PERIODS:
        return f"{len(periods)}, periods {min(periods):g} to {max(periods):g} s"
    return f"{len(periods)}, period{'s' if len(periods) > 1 else ''} {listed(f'{each:.7g}' for each in periods)} s"


def _each(pendulums: Sequence[Pendulum], said: Callable[[Pendulum], Any]) -> str:
    """Words of the pendulums that have the term; those of the same words together."""
    by_words: dict[str, list[str]] = {}
    for each in pendulums:
        words = said(each)
        if words:
            by_words.setdefault(words, []).append(each.label)
    if [len(labels) for labels in by_words.values()] == [len(pendulums)]:
        return next(iter(by_words))
    return "; ".join(f"{listed(labels)}: {words}" for words, labels in by_words.items())


def _resistance(field: str, pendulum: Pendulum) -> str:
    """Its numbers with their units; empty where there is none."""
    value = getattr(pendulum, field)
    if not value:
        return ""
    of = type(value) if isinstance(value, Section) else Pendulum
    numbers = value.model_dump() if isinstance(value, Section) else {field: value}
    units = {name: extra(of, name)["unit"] for name in numbers}
    return ", ".join(
        f"{name} {number:g} {units[name]}" if len(numbers) > 1 else f"{number:g} {units[name]}"
        for name, number in numbers.items()
    )


def _escapement(pendulum: Pendulum) -> str | None:
    match pendulum.escapement:
        case VanDerPolEscapement() as drive:
            return f"van der Pol, {drive.rate:g} 1/s up to {drive.angle:g} rad"
        case ImpulseEscapement() as kick:
            ways = "both ways" if kick.direction == "both" else kick.direction
            return f"kicks of {kick.energy:g} rad2/s2 at {kick.angle:g} rad, {ways}"
    return None


def _support(support: Any) -> str:
    match support:
        case BeamSupport():
            system = {"full": "system (1)", "reduced": "system (2)"}[support.equations]
            return f"elastic beam, {system}, {support.mass:g} kg on {support.stiffness:g} N/m"
        case FrameSupport():
            return f"flexible frame, {support.mass:g} kg on {support.stiffness:g} N/m"
        case BoardSupport():
            return f"rolling board, coupling {support.coupling:g}"
    return "fixed"


def _readings(scene: Scene, clock: Clock) -> str:
    step = float(scene.recording.step)
    jitter = f", off by {scene.recording.jitter:g} s" if scene.recording.jitter else ""
    return f"{clock.count}, one every {step:g} s{jitter}, for {scene.duration:g} s"
