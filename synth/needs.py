"""What a scene asks of a propagator, in words: the terms of its equations of motion that not every propagator knows."""

from __future__ import annotations

from data_schemas.scene import Scene
from data_schemas.scene_checks import frequency
from data_schemas.scene_pendulum import RESISTANCES, Pendulum

LINEAR, SINE = "the linear law", "the sine law"
OVERDAMPED = "overdamping"
VERTICAL = "vertical motion"
VAN_DER_POL = "a van der Pol escapement"
IMPULSE = "an impulse escapement"
KICKS = "random kicks"
HANDLING = "knocks and restarts"
PLANES = "planes of swing that are not parallel"
CHANGING = "changing gravity"
FIXED, BEAM, REDUCED_BEAM = "a fixed support", "an elastic beam", "the reduced beam"
FRAME, BOARD = "a flexible frame", "a rolling board"
UNEVEN = "uneven times"

_LOOKED_AFTER = {
    "label", "period", "mass", "temperature_coefficient", "density_coefficient", "drift", "start", "damping_rate",
    "kick_intensity", "escapement", "plane",
}  # fmt: skip
_HARDLY_SWINGS = 0.5  # of the frequency: from this damping rate on, the closed form would lose digits
_SUPPORTS = {"fixed": FIXED, "beam": BEAM, "frame": FRAME, "board": BOARD}


def needs(scene: Scene) -> tuple[str, ...]:
    """Terms of the equations of motion beyond viscous damping and horizontal motion.

    Examples
    --------
    >>> from data_schemas.scene import load_scene
    >>> from synth.shipped import scene_path
    >>> needs(load_scene(scene_path("linear")))
    ('the linear law', 'a fixed support')
    """
    pendulums = scene.pendulums
    drives = {each.escapement.kind for each in pendulums if each.escapement is not None}
    vertical = any(term.axis == "vertical" and term.kind != "still" for term in scene.motion)
    vertical |= scene.case is not None and scene.case.roll is not None
    vertical |= scene.conditions.temperature_amplitude > 0  # acts as a vertical motion that no instrument feels
    asked = {
        LINEAR if scene.restoring == "linear" else SINE: True,
        OVERDAMPED: any(each.damping_rate >= _HARDLY_SWINGS * frequency(scene, each) for each in pendulums),
        VERTICAL: vertical,
        **{name: True for each in pendulums for name in _own_terms(each)},
        VAN_DER_POL: "van-der-pol" in drives,
        IMPULSE: "impulse" in drives,
        KICKS: any(each.kick_intensity for each in pendulums),
        HANDLING: bool(scene.events),
        PLANES: any(each.plane for each in pendulums),
        CHANGING: scene.gravity_course is not None or scene.conditions.tide,
        _support(scene): True,
        UNEVEN: scene.recording.jitter > 0,
    }
    return tuple(name for name, is_asked in asked.items() if is_asked)


def _own_terms(pendulum: Pendulum) -> list[str]:
    """What resists its swing beside viscous damping; any field that nothing looks after is a term too."""
    fields = {name: field for name, field in type(pendulum).model_fields.items() if name not in _LOOKED_AFTER}
    return [RESISTANCES.get(name, name) for name, field in fields.items() if getattr(pendulum, name) != field.default]


def _support(scene: Scene) -> str:
    if scene.support.kind == "beam" and scene.support.equations == "reduced":
        return REDUCED_BEAM
    return _SUPPORTS[scene.support.kind]
