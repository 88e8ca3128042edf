"""What a scene asks of a propagator, which suits it, which may stand in for that one, and why."""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from data_schemas.errors import SceneError
from data_schemas.scene import Propagator, Scene, frequency
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
_SUPPORTS = {"fixed": FIXED, "beam": BEAM, "reduced": REDUCED_BEAM, "frame": FRAME, "board": BOARD}


def needs(scene: Scene) -> tuple[str, ...]:
    """Terms of the equations of motion beyond viscous damping and horizontal motion."""
    pendulums = scene.pendulums
    support = "reduced" if getattr(scene.support, "equations", None) == "reduced" else scene.support.kind
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
        _SUPPORTS[support]: True,
        UNEVEN: scene.recording.jitter > 0,
    }
    return tuple(name for name, is_asked in asked.items() if is_asked)


def _own_terms(pendulum: Pendulum) -> list[str]:
    """What resists its swing beside viscous damping; any field that nothing looks after is a term too."""
    fields = type(pendulum).model_fields.items()
    given = (name for name, field in fields if getattr(pendulum, name) != field.default)
    return [RESISTANCES.get(name, name) for name in given if name not in _LOOKED_AFTER]


_KINKED = {*RESISTANCES.values()}
_SMOOTH = {LINEAR, SINE, OVERDAMPED, VERTICAL, VAN_DER_POL, UNEVEN, CHANGING} | _KINKED
_YIELDING = {BEAM, REDUCED_BEAM, FRAME, BOARD}


class _Kind(NamedTuple):
    """Name of a propagator in the truth; usual error of an hour, of the largest angle; terms that it knows."""

    name: str
    reached: float
    known: set[str]


_KINDS: dict[Propagator, _Kind] = {
    "closed-form": _Kind("closed form", 1e-15, {FIXED, LINEAR, UNEVEN, PLANES}),
    "picard": _Kind(
        "Picard collocation", 1e-14, {FIXED, LINEAR, SINE, VERTICAL, UNEVEN, KICKS, HANDLING, CHANGING, PLANES}
    ),
    "beam-collocation": _Kind("beam collocation", 1e-13, {LINEAR, SINE, VERTICAL, VAN_DER_POL, UNEVEN} | _YIELDING),
    "explicit": _Kind("explicit, order 8", 1e-13, _SMOOTH | _YIELDING | {FIXED, IMPULSE, KICKS, HANDLING}),
    "radau": _Kind("Radau IIA, orders 9 and 13", 1e-12, _SMOOTH | _YIELDING | {FIXED}),
}
NAMES = {key: kind.name for key, kind in _KINDS.items()}
"""Propagators by their names in a scene, and as the truth calls them."""

_SMOOTH_AIM, _KINKED_AIM = 1e-13, 1e-11  # a kink in the forces costs ever more steps the less error is allowed
_STIFF = 100.0  # rates of the equations above the fastest swing from which Radau's few costly steps are the cheaper


class Choice(NamedTuple):
    """A propagator."""

    propagator: Propagator  # Its name in a scene
    why: str  # In one line
    instead: tuple[Propagator, ...] = ()  # Who may stand in for it, in this order, should it refuse
    aim: float = _SMOOTH_AIM  # Tolerance for integrators where the scene gives none: what an hour of swings allows

    @property
    def integrates(self) -> bool:
        """Whether it is one of the integrators of `synth.integrators`."""
        return self.propagator not in ("closed-form", "picard")

    def expected_error(self, tolerance: float | None) -> float:
        """Usual error, of the largest angle; the truth says the one that was estimated."""
        usual = _KINDS[self.propagator].reached
        return max(usual, self.aim if tolerance is None else tolerance) if self.integrates else usual


def choose(named: Propagator, asked: Sequence[str], fastest: Callable[[], float]) -> Choice:
    """Choose by what a scene asks for, and where that does not decide by the fastest rate of its equations over that of
    the swing.

    `SceneError` if the scene names a propagator that cannot do it, or none can.
    """
    unknown = [name for name in asked if all(name not in kind.known for kind in _KINDS.values())]
    if unknown:
        raise SceneError(f"pendulums: no propagator knows {listed(unknown)}")
    aim = _SMOOTH_AIM if _KINKED.isdisjoint(asked) else _KINKED_AIM
    able = [key for key, kind in _KINDS.items() if kind.known.issuperset(asked)]
    if named != "auto":
        if named in able:
            return Choice(named, "the scene names it", aim=aim)
        lacking = [name for name in asked if name not in _KINDS[named].known]
        others = " or ".join(repr(key) for key in [*able, "auto"])
        raise SceneError(f"simulation.propagator = {named!r} does not know {listed(lacking)}; choose {others}")
    if "closed-form" in able:
        return Choice("closed-form", "linear pendulums on a fixed support have a solution in closed form")
    at_set_times = [name for name in (KICKS, HANDLING) if name in asked]
    if "picard" in able:
        more = [*at_set_times, *({CHANGING} & {*asked})]
        what = "real pendulums" if SINE in asked else f"linear pendulums with {listed(more)}"
        why = f"{what} on a fixed support: the exact linear motion, and a small remainder"
        instead: tuple[Propagator, ...] = ("explicit",) if at_set_times else ("explicit", "radau")
        return Choice("picard", why, () if PLANES in asked else instead)
    if PLANES in asked:
        raise SceneError(f"pendulums.plane: no propagator knows {PLANES} beside resistance other than viscous")
    if at_set_times:
        why = f"{listed(at_set_times)} come at set times, to which this propagator steps"
        return Choice("explicit", why, aim=aim)
    if IMPULSE in asked:
        return Choice("explicit", "an impulse escapement kicks at instants that this propagator locates", aim=aim)
    ratio = fastest()
    cause = listed([name for name in asked if name not in (LINEAR, SINE, FIXED, UNEVEN)])
    rates = f"the fastest rate is {ratio:.3g} times the swing's"
    if ratio > _STIFF:
        return Choice("radau", f"{cause}: stiff, {rates}", ("explicit",), aim)
    if "beam-collocation" in able:
        return Choice("beam-collocation", f"{cause}: smooth and not stiff, {rates}", ("explicit", "radau"), aim)
    return Choice("explicit", f"{cause}: not stiff, {rates}", ("radau",), aim)


def listed(names: Iterable[str]) -> str:
    """Names in a sentence: one, two and three."""
    names = list(names)
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
