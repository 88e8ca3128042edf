"""Many members of one scene, simulated in memory, in order and lazily."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

from data_schemas.contents import Contents, to_tree
from data_schemas.errors import UsageError
from data_schemas.scene import Scene
from synth.ensemble_scenes import Vary
from synth.ensemble_scenes import members as scenes_of
from synth.streaming import simulated
from synth.workers import in_order

if TYPE_CHECKING:
    import xarray as xr


class Member(NamedTuple):
    """One member of an ensemble, simulated."""

    number: int
    """Counted from 1."""
    record: xr.DataTree
    truth: xr.DataTree
    """As `simulate` gives them; the truth's attribute ``scene`` is the member's own scene."""


def simulate_ensemble(
    scene: Scene, members: int, *, seed: int | None = None, vary: Vary | None = None, workers: int = 1
) -> Iterator[Member]:
    """Simulate many members of a scene, which differ by seed and by what varies.

    A member is the same bits whatever `members` and `workers` are, and the same as `simulate` of its scene.

    Parameters
    ----------
    scene
        What the members share.
    members
        How many.
    seed
        Of the ensemble; the scene's own if left out. Each member has a seed of its own, from this and its number.
    vary
        What else differs: keys of the scene by dotted path, such as ``pendulums.0.start.phase`` (lists counted from 0),
        with a pair (low, high), drawn from evenly, or a callable that is given a `numpy.random.Generator`.
    workers
        Processes. With more than one, a script must be startable by others, that is have its work under
        ``if __name__ == "__main__":``.

    Returns
    -------
    iterator of Member
        (number, record, truth), in order. Members are made as they are asked for, no more than two to a worker ahead:
        memory does not grow with their number.

    Raises
    ------
    SceneError
        As `simulate`; for a key or range that cannot be meant, at once.
    UsageError
        If there is no worker.
    WorkerError
        If a process dies.

    See Also
    --------
    synth.write_ensemble : to files.

    Examples
    --------
    >>> from data_schemas.scene import load_scene
    >>> from synth import scene_path
    >>> linear = load_scene(scene_path("linear"))
    >>> for number, record, truth in simulate_ensemble(linear, 2, vary={"gravity": (9.7, 9.9)}):
    ...     print(number, record.attrs["record_id"], 9.7 < float(truth["truth/gravity"]) < 9.9)
    1 linear-0001 True
    2 linear-0002 True
    """
    if workers < 1:
        raise UsageError(f"workers = {workers}: give 1 or more")
    return _made(scenes_of(scene, members, seed=seed, vary=vary), min(workers, members))


def _made(scenes: Iterator[Scene], workers: int) -> Iterator[Member]:
    made: Iterator[tuple[Contents, Contents]] = in_order(simulated, scenes, workers)
    for number, (record, truth) in enumerate(made, start=1):
        yield Member(number, to_tree(record), to_tree(truth))
