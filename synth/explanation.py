"""What would be computed, how and why, without computing it."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from data_schemas.scene import Scene
from data_schemas.scene_fields import Section, extra
from data_schemas.scene_pendulum import RESISTANCES, Pendulum
from synth.choice import NAMES, listed
from synth.motion.harmonic_sum import HarmonicSum
from synth.plan import Plan, plan
from synth.recording.clock import set_clock

_MOST_PERIODS = 4


def explain(scene: Scene) -> dict[str, Any]:
    """The terms of a scene, who would integrate them, why and how exactly; `SceneError` if it cannot be simulated."""
    clock, recording = set_clock(scene), scene.recording
    jitter = f", off by {recording.jitter:g} s" if recording.jitter else ""
    whole = plan(scene, clock)
    terms, choice = _terms(scene, whole), whole.choice
    present = {name: words for name, words in terms.items() if words}
    return {
        "pendulums": _periods(scene.pendulums),
        "terms": present if whole.caution is None else present | {"caution": whole.caution},
        "left_out": tuple(name for name, words in terms.items() if not words),  # no code is compiled or run for them
        "readings": f"{clock.count}, one every {float(recording.step):g} s{jitter}, for {scene.duration:g} s",
        "propagator": whole.propagator,
        "why": choice.why,
        "instead": tuple(NAMES[name] for name in choice.instead),  # should it refuse
        "tolerance": whole.tolerance,
        "expected_error": choice.expected_error(whole.tolerance),  # of the largest angle
    }


def _terms(scene: Scene, whole: Plan) -> dict[str, str]:
    """Words of all terms that there are, empty for those that the scene does not name."""
    pendulums, course = scene.pendulums, scene.gravity_course
    changing = "" if course is None else f"{course.kind}, mean change {whole.mean_change:.3g} m/s2"
    return {
        "restoring": "the full sine" if scene.restoring == "sine" else "linear, for small arcs",
        **{name: _each(pendulums, partial(_numbers, field)) for field, name in RESISTANCES.items()},
        "escapement": _each(pendulums, _escapement),
        "yielding support": _support(scene.support),
        "horizontal motion": _motion(scene, "horizontal", whole.motion),
        "vertical motion": _motion(scene, "vertical", whole.vertical),
        "random kicks": _each(pendulums, partial(_numbers, "kick_intensity")),
        "changing gravity": changing,
        "tide": "of a yielding Earth" if scene.conditions.tide else "",
        "tilting case": _case(scene),
        "planes of swing": _each(pendulums, lambda one: f"{one.plane:g} rad off" if one.plane else ""),
        "handling": listed(f"{each.kind} of {each.pendulum} at {each.time:g} s" for each in scene.events),
    }


def _periods(pendulums: Sequence[Pendulum]) -> str:
    periods = [each.period for each in pendulums]
    if len(periods) > _MOST_PERIODS:
        return f"{len(periods)}, periods {min(periods):g} to {max(periods):g} s"
    return f"{len(periods)}, period{'s' if len(periods) > 1 else ''} {listed(f'{each:.7g}' for each in periods)} s"


def _each(pendulums: Sequence[Pendulum], said: Callable[[Pendulum], str]) -> str:
    """Words of the pendulums that have the term; those of the same words together."""
    by_words: dict[str, list[str]] = {}
    for each in pendulums:
        by_words.setdefault(said(each), []).append(each.label)
    if len(by_words) == 1:
        return next(iter(by_words))
    return "; ".join(f"{listed(labels)}: {words}" for words, labels in by_words.items() if words)


def _numbers(field: str, pendulum: Pendulum) -> str:
    """The numbers of a field with their units; empty where it is absent."""
    value = getattr(pendulum, field)
    if not value:
        return ""
    if not isinstance(value, Section):
        return f"{value:g} {extra(Pendulum, field)['unit']}"
    numbers = value.model_dump().items()
    return ", ".join(f"{name} {number:g} {extra(type(value), name)['unit']}" for name, number in numbers)


def _escapement(pendulum: Pendulum) -> str:
    drive = pendulum.escapement
    if drive is None:
        return ""
    if drive.kind == "van-der-pol":
        return f"van der Pol, {drive.rate:g} 1/s up to {drive.angle:g} rad"
    ways = "both ways" if drive.direction == "both" else drive.direction
    return f"kicks of {drive.energy:g} rad2/s2 at {drive.angle:g} rad, {ways}"


def _support(support: Any) -> str:
    match support.kind:
        case "fixed":
            return ""
        case "board":
            return f"rolling board, coupling {support.coupling:g}"
    what = "flexible frame" if support.kind == "frame" else "elastic beam, system "
    number = {"full": "(1)", "reduced": "(2)"}.get(getattr(support, "equations", ""), "")
    return f"{what}{number}, {support.mass:g} kg on {support.stiffness:g} N/m"


def _motion(scene: Scene, axis: str, motion: HarmonicSum) -> str:
    kinds = dict.fromkeys(term.kind for term in scene.motion if term.axis == axis and term.kind != "still")
    if not kinds:
        return ""
    count = motion.angular_frequency.size
    of_what = "" if list(kinds) == ["harmonics"] else f": {listed(kinds)}"
    return f"{count} harmonic{'s' if count > 1 else ''}{of_what}"


def _case(scene: Scene) -> str:
    if scene.case is None:
        return ""
    tilts = [name for name in ("pitch", "roll") if getattr(scene.case, name) is not None]
    return f"{listed(tilts) or 'at rest'}, elongations from the {scene.case.reference}"
