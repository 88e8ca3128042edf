"""Many members of one scene, in order: in memory and lazily, or straight to files, where an interrupted run goes on."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from data_schemas.contents import Contents, shown, to_tree
from data_schemas.errors import FileError, UsageError
from data_schemas.reading import skim
from data_schemas.scene import Scene
from data_schemas.writing import write_text
from synth.ensemble_scenes import Vary, value
from synth.ensemble_scenes import members as scenes_of
from synth.recording.observe import history
from synth.streaming import simulate_to, simulated
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


class Written(NamedTuple):
    """What became of an ensemble."""

    manifest: Path
    """Table of the members: number, seed, what varies, names of the files."""
    made: int
    kept: int
    """Members whose files were there already."""


class _Job(NamedTuple):
    scene: Scene
    record: Path
    truth: Path


def write_ensemble(
    scene: Scene,
    members: int,
    folder: str | os.PathLike[str],
    *,
    name: str | None = None,
    seed: int | None = None,
    vary: Vary | None = None,
    workers: int = 1,
    overwrite: bool = False,
    progress: Callable[[int, int], object] | None = None,
) -> Written:
    """Simulate many members of a scene to files ``NAME-0001.record.nc``, ``NAME-0001.truth.nc``, ...

    Member by member they are what `simulate_ensemble` gives, bit for bit. A member whose two files are there, whole and
    of the same scene, is kept: after an interrupt the same call goes on, and with more members it adds to them.

    Parameters
    ----------
    scene, members, seed, vary
        As `simulate_ensemble`.
    folder
        Of all files; it must exist.
    name
        What their names begin with; the scene's record_id if left out.
    workers
        Processes. With more than one, a script must have its work under ``if __name__ == "__main__":``.
    overwrite
        Make all members anew, whatever is there.
    progress
        Called with how many members are done, and of how many.

    Returns
    -------
    Written
        The table ``NAME.ensemble.csv`` of all members is written with the first.

    Raises
    ------
    SceneError
        As `simulate`; for keys, ranges and members' values that cannot be meant, before any work.
    FileError
        As `data_schemas.write`; and if a file is there that is not this member's, before any work.
    UsageError
        If there is no worker.
    WorkerError
        If a process dies.
    """
    if workers < 1:
        raise UsageError(f"workers = {workers}: give 1 or more")
    name = scene.record_id if name is None else name
    manifest = Path(folder) / f"{name}.ensemble.csv"
    numbered = enumerate(scenes_of(scene, members, seed=seed, vary=vary), start=1)
    jobs = [
        _Job(one, *(Path(folder) / f"{name}-{number:04d}.{kind}.nc" for kind in ("record", "truth")))
        for number, one in numbered
    ]
    left = [job for job in jobs if overwrite or not _is_made(job)]
    kept = len(jobs) - len(left)
    made = in_order(_make, left, max(1, min(workers, len(left))))
    for done, _ in enumerate(made, start=kept + 1):
        if done == kept + 1:  # before the first is made there is nothing to tell of
            write_text(_table(jobs, list(vary or {})), manifest, overwrite=True)
        if progress is not None:
            progress(done, len(jobs))
    if not left:
        write_text(_table(jobs, list(vary or {})), manifest, overwrite=True)
    return Written(manifest, len(left), kept)


def _make(job: _Job) -> None:
    # what is there may be replaced: it is half of this member, or the caller said so
    simulate_to(job.scene, job.record, job.truth, overwrite=True)


def _is_made(job: _Job) -> bool:
    """Whether both files of a member are there, whole and of its scene; neither or one of them: no.

    `FileError` if a file is something else.
    """
    there = 0
    scene = job.scene
    for path, attribute, wanted in (
        (job.record, "history", history(scene)),
        (job.truth, "scene", scene.model_dump_json()),
    ):
        if not path.exists():
            continue
        try:
            contents, _ = skim(path)
        except FileError as error:
            raise FileError(f"{error}; or give --force (overwrite=True) to make it anew") from None
        if contents[""].attrs.get(attribute) != wanted:
            raise FileError(
                f"{shown(path, 400)}: exists already, of another scene or seed; give --force (overwrite=True) to "
                "replace it, or choose another folder"
            )
        there += 1
    return there == 2


def _table(jobs: list[_Job], keys: list[str]) -> str:
    """CSV of the members; numbers so that they read back as the same double."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["member", "seed", *keys, "record", "truth"])
    for number, job in enumerate(jobs, start=1):
        varied = [value(job.scene, key) for key in keys]
        table.writerow([number, job.scene.seed, *varied, job.record.name, job.truth.name])
    return text.getvalue()
