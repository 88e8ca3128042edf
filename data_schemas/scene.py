"""A scene: everything the simulator needs to know, read from TOML or built from Python."""

import itertools
import math
import os
from fractions import Fraction
from pathlib import Path
from typing import Literal, Self

from pydantic import field_validator, model_validator

from data_schemas.errors import SceneError
from data_schemas.scene_fields import (
    Number,
    Section,
    Seed,
    Text,
    check_distinct,
    check_known,
    load_section,
    quantity,
    refuse,
)
from data_schemas.scene_motion import Case, Conditions, GravityCourse, Motion
from data_schemas.scene_pendulum import RESISTANCES, FixedSupport, Handling, Pendulum, Support
from data_schemas.scene_recording import Film, Recording, Trace

LARGEST_CHANGE = 1e-2  # Of gravity: 10 Gal, far more than a ship meets
_MOST_SAMPLES = 200_000_000
_ONE_METAL = 1e-3  # of the relative change of period: n1/n2 then stays within 1e-7 at 10 K
_TURN = 7.292115e-5  # rad/s, GRS80
_AXIS, _SQUARE_ECCENTRICITY = 6378137.0, 0.00669438002290  # m, GRS80

Propagator = Literal["auto", "closed-form", "picard", "beam-collocation", "explicit", "radau"]


class Simulation(Section):
    """Left out, everything is as exact as it can be."""

    tolerance: Number | None = quantity(None, "1", "error over angle; left out: the least possible", ge=1e-15, le=1e-2)
    propagator: Propagator = quantity("auto", "", "'auto' takes what suits the scene; a name insists or is refused")


class Scene(Section):
    """Pendulums, the motion of their support, and the recording.

    Examples
    --------
    >>> scene = Scene.model_validate(
    ...     {
    ...         "record_id": "two",
    ...         "duration": 10.0,
    ...         "gravity": 9.81,
    ...         "pendulums": [
    ...             {"label": "1", "period": 1.0, "start": {"kind": "free", "amplitude": 0.01}},
    ...             {"label": "2", "period": 1.001, "start": {"kind": "free", "amplitude": 0.01}},
    ...         ],
    ...     }
    ... )
    >>> [trace.name for trace in scene.traces]
    ['1', '1-2']
    """

    record_id: Text = quantity(..., "", "identifier of the record", pattern=r"^[A-Za-z0-9][A-Za-z0-9_.+-]{0,58}$")
    title: Text = quantity("", "", "what the record shows", max_length=400)
    seed: Seed = quantity(0, "1", "all chance in the scene comes from this number")
    start_time: Text = quantity(
        "2000-01-01T00:00:00Z",
        "",
        "date and time of t = 0",
        pattern=r"^[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}Z$",
    )
    duration: Number = quantity(..., "s", "length of the record, by its chronometer", gt=0, le=1e8)
    gravity: Number = quantity(..., "m s-2", "true gravity, without gravity_course", ge=0.1, le=100)
    gravity_course: GravityCourse | None = quantity(None, "", "added to gravity: kind = 'linear', 'sine' or 'table'")
    reference_gravity: Number = quantity(9.81, "m s-2", "gravity at which the stated periods hold", ge=0.1, le=100)
    restoring: Literal["linear", "sine"] = quantity("linear", "", "restoring law: 'linear' for small arcs, or 'sine'")
    pendulums: tuple[Pendulum, ...] = quantity(..., "", "the pendulums, in order", min_length=1, max_length=100)
    motion: tuple[Motion, ...] = quantity((), "", "terms of the ship's acceleration; they add")
    support: Support = quantity(FixedSupport(), "", "they hang on this: kind = 'fixed', 'beam', 'frame' or 'board'")
    conditions: Conditions = quantity(Conditions(), "", "heat, air, tilt, turn, the ship's way, base stations")
    case: Case | None = quantity(None, "", "the case of the apparatus, where it tilts: pitch, roll, what is measured")
    events: tuple[Handling, ...] = quantity((), "", "events: kind = 'knock', 'restart', 'release' or 'clamp'")
    recording: Recording = quantity(Recording(), "", "what is written down of the motion")
    film: Film | None = quantity(None, "", "the film to which `expose` writes the traces; `simulate` makes none")
    simulation: Simulation = quantity(Simulation(), "", "how exactly the motion is computed, and by what")

    @field_validator("start_time")
    @classmethod
    def _a_date(cls, value: str) -> str:
        from datetime import datetime

        datetime.fromisoformat(value)  # raises for the 31st of February
        return value

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        labels = [pendulum.label for pendulum in self.pendulums]
        check_distinct(labels, "pendulums must have different labels")
        for term in self.motion:
            if term.kind == "near-resonant" and term.pendulum is not None:
                check_known([term.pendulum], labels, "motion names the pendulum")
        check_physics(self)
        for trace in self.traces:
            check_known(trace.combination, labels, f"trace {trace.name!r} names the pendulum")
        count, end = self.count, self.duration
        refuse(count > _MOST_SAMPLES, f"duration and sampling rate ask for {count} readings; at most {_MOST_SAMPLES}")
        for what in self.events:
            check_known([what.pendulum], labels, "events name the pendulum")
            refuse(what.time >= end, f"events: the {what.kind} at {what.time:g} s is after the record's end")
        named = [errors.trace for errors in self.recording.errors if errors.trace is not None]
        check_known(named, [trace.name for trace in self.traces], "recording.errors name the trace")
        for stretch in self.recording.missing:
            refuse(stretch.start >= end, f"recording.missing begins at {stretch.start:g} s, after the record's end")
        for name in ("missing_samples", "outliers"):
            wrong = getattr(self.recording, name) > count
            refuse(wrong, f"recording.{name} is more than the {count} readings of a trace")
        return self

    @property
    def traces(self) -> tuple[Trace, ...]:
        """The recorded traces: as named, or the first pendulum and the successive differences."""
        if self.recording.traces is not None:
            return self.recording.traces
        labels = [pendulum.label for pendulum in self.pendulums]
        first = Trace(name=labels[0], combination={labels[0]: 1.0})
        pairs = itertools.pairwise(labels)
        return (first, *(Trace(name=f"{a}-{b}", combination={a: 1.0, b: -1.0}) for a, b in pairs))

    @property
    def count(self) -> int:
        """Number of readings before any is dropped: at 0, step, 2 step ... below the duration."""
        return math.ceil(Fraction(str(self.duration)) / self.recording.step)


def load_scene(path: str | os.PathLike[str], *, allow_paths: bool = False) -> Scene:
    """Read a scene, checked and frozen, from a TOML file, whose folder its paths are relative to.

    `allow_paths`: whether the tables that it names may lie elsewhere than in that folder or below. `SceneError`, in one
    line: the file, every faulty key, its value and what is allowed; for an unknown key also the nearest known one.
    """
    context = {"folder": Path(path).parent, "anywhere": allow_paths}
    return load_section(path, Scene, "a scene", SceneError, context=context)


def period(scene: Scene, pendulum: Pendulum) -> float:
    """Period of a pendulum at reference gravity under the scene's conditions, in the middle of the record, s."""
    given = scene.conditions
    value = pendulum.period + pendulum.drift * 0.5 * scene.duration / 86400.0
    if given.temperature is not None:
        value += pendulum.temperature_coefficient * (given.temperature - given.temperature_reference)
    if given.air_density is not None:
        value += pendulum.density_coefficient * given.air_density / given.air_density_reference
    return value


def lightening(latitude: float, speed: float, course: float) -> float:
    """Loss of gravity on a ship under way, m/s^2, upright centrifugal force of its motion less the Earth's own.

    `latitude` and `course`, from north by east, are in degrees, `speed` over ground in m/s.
    """
    slant, way = math.radians(latitude), math.radians(course)
    bulge = math.sqrt(1.0 - (math.sqrt(_SQUARE_ECCENTRICITY) * math.sin(slant)) ** 2)
    east, north = speed * math.sin(way), speed * math.cos(way)
    ring = _AXIS * math.cos(slant) / bulge  # radius of the parallel
    ground = _TURN * ring
    if ring > 1.0:
        eastward = ((ground + east) ** 2 - ground**2) / ring * math.cos(slant)
    else:  # at a pole, where the parallel is a point
        eastward = east**2 * bulge / _AXIS
    return eastward + north**2 * bulge**3 / (_AXIS * (1.0 - _SQUARE_ECCENTRICITY))


def _in_plane(scene: Scene) -> float:
    """Gravity along the plane of swing that does not turn, m/s^2."""
    given, gravity = scene.conditions, scene.gravity
    if given.speed is not None and given.course is not None and given.latitude is not None:
        gravity -= lightening(given.latitude, given.speed, given.course)
    return gravity * math.cos(given.tilt) if given.tilt else gravity


def felt_gravity(scene: Scene) -> float:
    """What accelerations of the support compare with: gravity less what tilt, turn and the ship's way take, m/s^2."""
    turn = scene.conditions.yaw_rate or 0.0
    lengths = [scene.reference_gravity * (period(scene, each) / (2 * math.pi)) ** 2 for each in scene.pendulums]
    return _in_plane(scene) - (turn**2 * sum(lengths) / len(lengths) if turn else 0.0)


def frequency(scene: Scene, pendulum: Pendulum) -> float:
    """Circular frequency at infinitesimal arc on a rigid support at the scene's gravity and conditions, rad/s."""
    own = 2 * math.pi / period(scene, pendulum) * math.sqrt(_in_plane(scene) / scene.reference_gravity)
    turn = scene.conditions.yaw_rate or 0.0
    return math.sqrt(own**2 - turn**2) if turn else own


def check_physics(scene: Scene) -> None:
    """Raise ValueError, with the remedy, for what has no equations of motion: linear pendulums in heave, say."""
    linear, case = scene.restoring == "linear", scene.case
    sine = "on real pendulums only; set restoring = 'sine'"
    refuse(linear and any(term.axis == "vertical" for term in scene.motion), f"a vertical motion acts {sine}")
    _check_conditions(scene)
    if scene.support.kind != "fixed":
        _check_fixed(scene)
    refuse(linear and case is not None and case.roll is not None, f"case.roll acts {sine}")
    course, largest = scene.gravity_course, 0.0  # of a table it is known once that is read
    if course is not None and course.kind == "linear":
        largest = abs(course.rate) * scene.duration
    elif course is not None and course.kind == "sine":
        largest = abs(course.amplitude)
    told = f"gravity_course changes gravity by {largest:.3g} m/s^2, above {LARGEST_CHANGE:g} of it; make it smaller"
    refuse(largest > LARGEST_CHANGE * scene.gravity, told)
    for each in scene.pendulums:
        own = frequency(scene, each)
        told = f"pendulums: {each.label!r} with damping_rate = {each.damping_rate:g} 1/s creeps and has no free"
        told += f" harmonic (its frequency is {own:g} rad/s); start it with kind = 'state'"
        refuse(each.start.kind == "free" and each.damping_rate >= own, told)
    _check_support(scene)


def _check_conditions(scene: Scene) -> None:
    given, name = scene.conditions, "conditions.temperature_amplitude"
    lonely = scene.support.kind != "fixed" and (given != type(given)() or any(each.drift for each in scene.pendulums))
    refuse(lonely, "conditions act on pendulums on a fixed support only; remove them, or the support")
    for each in scene.pendulums:
        wrong = period(scene, each) <= 0.5 * each.period or (given.yaw_rate or 0.0) * each.period > 1.0
        refuse(wrong, f"conditions: {each.label!r} would hardly swing; make coefficients or yaw_rate smaller")
    if given.temperature_amplitude:
        refuse(scene.restoring != "sine", f"{name} acts on real pendulums only; set restoring = 'sine'")
        shares = [each.temperature_coefficient / period(scene, each) for each in scene.pendulums]
        uneven = max(shares) - min(shares) > _ONE_METAL * max(abs(share) for share in shares)
        remedy = "give temperature coefficients in proportion to the periods"
        refuse(uneven, f"{name} needs pendulums of one metal; {remedy}")


def _check_fixed(scene: Scene) -> None:
    """Of a support that yields: what acts on pendulums on a fixed one only."""
    given, only = scene.pendulums, "pendulums on a fixed support"
    refuse(scene.gravity_course is not None, f"gravity_course acts on {only} only; remove it, or the support")
    wrong = scene.events or scene.case is not None or any(each.plane for each in given)
    refuse(wrong, f"events, case and plane are for {only}; remove them, or the support")
    kicked = any(each.kick_intensity for each in given)
    refuse(kicked, f"kick_intensity acts on {only} only; set it to 0, or fix the support")


def _check_support(scene: Scene) -> None:
    support = scene.support
    if support.kind == "fixed":
        return
    if support.kind == "beam" and support.equations == "reduced":
        _check_reduced(scene)
    else:
        told = f"support: pendulums on a {support.kind} swing with the full sine; set restoring = 'sine'"
        refuse(scene.restoring != "sine", told)
    if support.kind == "board":
        count = len(scene.pendulums)
        told = f"support: a coupling of {support.coupling:g} makes {count} metronomes outweigh the whole"
        refuse(support.coupling * count >= 1, f"{told}; make it smaller than {1 / count:g}")
        moved = any(term.axis == "horizontal" and term.kind != "still" for term in scene.motion)
        told = "support: a board that rolls freely stays behind when the ship moves sideways"
        refuse(moved, f"{told}; remove the horizontal motion, or choose the kind 'frame'")
        return
    for each in scene.pendulums:
        refuse(each.mass is None, f"pendulums: {each.label!r} moves the {support.kind} it hangs on; give its mass")


def _check_reduced(scene: Scene) -> None:
    what, remedy = "support: the reduced beam knows", "or choose equations = 'full'"
    refuse(scene.restoring != "linear", f"{what} small arcs only; set restoring = 'linear', {remedy}")
    moved = any(term.kind != "still" for term in scene.motion)
    refuse(moved, f"{what} no motion of the ship; remove it, {remedy}")
    for each in scene.pendulums:
        other = each.escapement is None or each.escapement.kind != "van-der-pol"
        refuse(other, f"{what} clocks with a van-der-pol escapement; give {each.label!r} one, {remedy}")
        resisted = any(getattr(each, name) for name in RESISTANCES)
        refuse(resisted, f"{what} no resistance; take that of {each.label!r} away, {remedy}")
