"""What a race on one problem gave: its points, compile times and the source of the truth, kept once it is finished."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import math
import platform
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from pipeline.benchmarks.kept import Kept
from pipeline.benchmarks.work_precision import Point, Row

_LIBRARIES = ("numpy", "scipy", "numba", "heyoka", "CyRK", "scikit-sundae")


@dataclass(frozen=True)
class Race:
    """One finished problem.

    Attributes
    ----------
    title, source : str
        Of the problem, and of what errors are measured against.
    points : list of Point
    compile_seconds : mapping of str to float
        By method, where it was measured.
    """

    title: str
    source: str
    points: list[Point]
    compile_seconds: Mapping[str, float] = field(default_factory=dict)

    def rows(self) -> Iterator[Row]:
        """As the suite yields them."""
        for point in self.points:
            yield point.row(self.source, self.compile_seconds.get(point.method, math.nan))


def raced_before(kept: Kept, name: str, race: Callable[[], Race], *, quick: bool) -> Race:
    """The race that `kept` knows of these libraries on this machine; else the race, run and kept."""
    configuration = {"suite": "integrators", "race": name, "quick": quick, "machine": machine()}
    known = kept.get(configuration)
    if known is not None:
        (found,) = known
        points = [Point(**each | {"seconds": tuple(each["seconds"])}) for each in found["points"]]
        return Race(found["title"], found["source"], points, found["compile_seconds"])
    finished = race()
    kept.put(configuration, [dataclasses.asdict(finished)])
    return finished


def machine() -> dict[str, Any]:
    """What times depend on besides the project's code."""
    versions = {}
    for library in _LIBRARIES:
        try:
            versions[library] = importlib.metadata.version(library)
        except importlib.metadata.PackageNotFoundError:
            versions[library] = "absent"
    return {"name": platform.node(), "processor": platform.machine(), "python": platform.python_version()} | versions
