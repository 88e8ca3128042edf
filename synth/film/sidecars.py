"""What is written beside a film: what the observer knows of it, and what he does not."""

from __future__ import annotations

from typing import Any

import numpy as np

from data_schemas.contents import Contents, Entry, Group
from data_schemas.film_conditions import BASE, BASES, PERIODS
from data_schemas.film_description import DescribedInstrument, DescribedPendulum, FilmDescription
from data_schemas.layouts import CONVENTIONS, LAYOUTS, VERSION
from data_schemas.variables import attributes
from synth.film.plan import FilmPlan
from synth.film.strips import Crossings
from synth.phase import Floats
from synth.recording.observe import described, label_array


def description_of(plan: FilmPlan) -> FilmDescription:
    """What the observer knows: the camera as it is meant to be, and the instrument as the record states it."""
    source, film, layout = plan.source, plan.film, plan.layout
    traces = [
        {
            "name": name,
            "combination": {
                label: float(weight) for label, weight in zip(source.pendulums, weights, strict=True) if weight
            },
            "lever": float(layout.lever[k]),
            "position": float(layout.position[k]),
        }
        for k, (name, weights) in enumerate(zip(source.traces, source.combination, strict=True))
    ]
    known = source.instrument
    labels = [str(each) for each in known.get("pendulum", source.pendulums)]
    own = [name for name in DescribedPendulum.model_fields if name in known]
    pendulums = [
        {"label": label, **{name: float(known[name][k]) for name in own}}
        for k, label in enumerate(labels)
        if label in source.pendulums
    ]
    scalars = {
        name: float(known[name])
        for name in DescribedInstrument.model_fields
        if name in known and np.ndim(known[name]) == 0
    }
    return FilmDescription.model_validate(
        {
            "record_id": source.record_id, "title": source.title, "start_time": source.start_time,
            "speed": film.speed, "dpi": film.dpi, "mark_interval": film.mark_interval, "gap": film.gap,
            "minute_code": film.minute_code, "restoring": source.restoring, "traces": traces, "pendulums": pendulums,
            "instrument": scalars, "bases": _bases(known, labels, source.pendulums),
            "readings": source.readings,
        }
    )  # fmt: skip


def _bases(known: dict[str, Any], labels: list[str], shown: tuple[str, ...]) -> list[dict[str, Any]]:
    """Occupations of base stations, as the record states them."""
    return [
        {
            "label": str(label),
            **{key: float(known[name][k]) for name, key in BASES.items() if name in known},
            **{
                key: {own: float(value) for own, value in zip(labels, known[name][k], strict=True) if own in shown}
                for name, key in PERIODS.items()
                if name in known
            },
        }
        for k, label in enumerate(known.get(BASE, ()))
    ]


class TruthOfFilm:
    """Lays out the truth of a film, portion by portion."""

    def __init__(self, plan: FilmPlan) -> None:
        source, layout, marks = plan.source, plan.layout, plan.marks
        scene = {} if source.scene is None else {"scene": source.scene.model_dump_json()}
        self._attrs = {
            "Conventions": CONVENTIONS,
            "schema": LAYOUTS["film-truth"].schema,
            "schema_version": VERSION,
            "record_id": source.record_id,
            "title": source.title,
            "history": f"exposed with seed {plan.seed}",
            "source": "model",
            "film": plan.film.model_dump_json(),
            "seed": plan.seed,
            **scene,
        }
        self._units = f"seconds since {source.start_time}"
        self._labels = {"trace": label_array(source.traces)}
        one = ("trace",)
        self._places = {
            "optical_lever": (one, layout.lever),
            "position": (one, layout.position),
            "offset": (one, layout.offset),
        }
        marked = {
            "mark_time": marks.time,
            "mark_row": plan.geometry.row_at_left(plan.transport.travel(marks.time)),
            "minute": marks.minute,
            "missing": marks.missing,
            "spurious": marks.spurious,
        }
        self._marks = described("marks", {name: (("mark",), value) for name, value in marked.items()}, {})

    def portion(self, time: Floats, found: Crossings) -> Contents:
        """The truth of some rows, given the times of their centre lines at the left edge, (rows,) s."""
        slices: dict[str, Any] = {
            "exposure_time": found.time,
            "elongation": found.elongation,
            "column": found.column,
            "slope": found.slope,
        }
        both = {name: (("trace", "time"), value) for name, value in slices.items()}
        return {
            "": Group(dict(self._attrs), {"time": Entry(("time",), time, attributes("time") | {"units": self._units})}),
            "slices": described("slices", self._places | both, self._labels),
            "marks": self._marks,
        }
