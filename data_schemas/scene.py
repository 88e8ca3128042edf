"""A scene: everything the simulator needs to know, read from TOML or built from Python."""

from __future__ import annotations

import itertools
import math
import os
from fractions import Fraction
from pathlib import Path
from typing import Literal, Self

from pydantic import ValidationError, field_validator, model_validator

from data_schemas.errors import SceneError
from data_schemas.scene_conditions import Conditions, GravityCourse, check_physics
from data_schemas.scene_fields import Number, Section, Seed, Text, check_distinct, check_known, one_line, quantity
from data_schemas.scene_film import Film
from data_schemas.scene_motion import Case, Motion
from data_schemas.scene_pendulum import FixedSupport, Handling, Pendulum, Support
from data_schemas.scene_recording import Recording, Trace
from data_schemas.text_files import load_toml

_MOST_SAMPLES = 200_000_000


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
        if self.count > _MOST_SAMPLES:
            raise ValueError(f"duration and sampling rate ask for {self.count} readings; at most {_MOST_SAMPLES}")
        for what in self.events:
            check_known([what.pendulum], labels, "events name the pendulum")
            if what.time >= self.duration:
                raise ValueError(f"events: the {what.kind} at {what.time:g} s is after the record's end")
        for errors in self.recording.errors:
            if errors.trace is not None:
                check_known([errors.trace], [trace.name for trace in self.traces], "recording.errors name the trace")
        for stretch in self.recording.missing:
            if stretch.start >= self.duration:
                raise ValueError(f"recording.missing begins at {stretch.start:g} s, after the record's end")
        for name in ("missing_samples", "outliers"):
            if getattr(self.recording, name) > self.count:
                raise ValueError(f"recording.{name} is more than the {self.count} readings of a trace")
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
    """Read a scene from a TOML file.

    Parameters
    ----------
    path
        The file. Paths inside it are relative to its folder.
    allow_paths : bool
        Whether the tables that it names may lie elsewhere than in that folder or below.

    Returns
    -------
    Scene
        Checked and frozen.

    Raises
    ------
    SceneError
        With one line that names the file, every faulty key, its value and what is allowed;
        for an unknown key also the nearest known one.
    """
    path = Path(path)
    content = load_toml(path, "a scene", SceneError)
    try:
        return Scene.model_validate(content, context={"folder": path.parent, "anywhere": allow_paths})
    except ValidationError as error:
        raise SceneError(f"{path}: {one_line(error, Scene)}") from None
