"""Many members of one scene, in order: in memory and lazily, or straight to files, where an interrupted run goes on.

A member depends on the ensemble's seed and its own number only, and each varied key draws from a generator of its own.
Processes are started afresh, not forked: a fork copies the threads' locks but not the threads.
"""

import csv
import difflib
import io
import math
import multiprocessing
import os
import re
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from pydantic import ValidationError

from data_schemas.contents import shown, to_tree
from data_schemas.errors import FileError, IsochronyError, SceneError, UsageError
from data_schemas.reading import skim
from data_schemas.scene import Scene
from data_schemas.scene_fields import one_line
from data_schemas.writing import write_text
from synth.recording.observe import history
from synth.seeds import generator
from synth.streaming import simulate_to, simulated

if TYPE_CHECKING:
    import xarray as xr

_RATIO = re.compile(r"\d+(/\d+)?")  # what a scene writes for a rate, such as 25 or 25/3
_PATIENCE = 10.0  # s that a process may take to clear away and end
_Job = tuple[Scene, Path, Path]  # a member with its two files
Job = TypeVar("Job")
Result = TypeVar("Result")
Range = tuple[float, float]
Vary = Mapping[str, Range | Callable[[np.random.Generator], Any]]
"""What varies: keys of a scene by dotted path, such as ``pendulums.0.start.phase``, lists counted from 0. A pair is
drawn from evenly (ends included for whole numbers); a callable is given a generator of random numbers."""


class WorkerError(IsochronyError):
    """A worker process died, of a lack of memory or by a signal."""

    exit_status = 70


def member_scenes(scene: Scene, count: int, *, seed: int | None = None, vary: Vary | None = None) -> Iterator[Scene]:
    """Scenes of the members 1 to `count`; their `record_id` ends with the member's number, such as ``-0001``.

    `SceneError` if a key or range cannot be meant, at once; if a member's values are not allowed, when it is reached.
    """
    if count < 1:
        raise SceneError(f"an ensemble of {count} members; ask for 1 or more")
    given = scene.model_dump(mode="json")
    for key, how in (vary or {}).items():
        section, last = _place(given, key)
        _refuse_range(key, how, section[last])
    return (member(scene, number, seed=seed, vary=vary) for number in range(1, count + 1))


def member(scene: Scene, number: int, *, seed: int | None = None, vary: Vary | None = None) -> Scene:
    """Scene of one member, counted from 1; see `member_scenes`."""
    whole = np.random.SeedSequence(scene.seed if seed is None else seed, spawn_key=(number,))
    own = int(whole.generate_state(1, np.uint64)[0] >> np.uint64(1))
    values = scene.model_dump(mode="json") | {"seed": own, "record_id": f"{scene.record_id}-{number:04d}"}
    for key, how in (vary or {}).items():
        section, last = _place(values, key)
        chance = generator(own, f"vary {key}")
        section[last] = how(chance) if callable(how) else _drawn(chance, how, section[last])
    try:
        return Scene.model_validate(values)
    except ValidationError as error:
        raise SceneError(f"member {number}: {one_line(error, Scene)}") from None


def value(scene: Scene, key: str) -> Any:
    """Value of a scene's key by dotted path."""
    section, last = _place(scene.model_dump(mode="json"), key)
    return section[last]


def _place(values: dict[str, Any], key: str) -> tuple[Any, Any]:
    """The section or list that holds a key, and its place there; `SceneError` if there is no such key."""
    section: Any = None
    place: Any = None
    within: Any = values
    for word in key.split("."):
        section = within
        place = int(word) if isinstance(section, list) and word.isascii() and word.isdigit() else word
        try:
            within = section[place]
        except (KeyError, IndexError, TypeError):
            if isinstance(section, dict) and section:
                near = difflib.get_close_matches(word, list(section), n=1, cutoff=0.0)
                fault = f"there is no {word!r} in this scene; did you mean {near[0]!r}?"
            elif isinstance(section, list) and section:
                fault = f"{word!r} is none of its parts, which are counted from 0 to {len(section) - 1}"
            else:
                fault = f"there is nothing below it; leave {word!r} out, or give the scene what is to vary"
            raise SceneError(f"vary {key}: {fault}") from None
    return section, place


def _refuse_range(key: str, how: Range | Callable[..., Any], now: Any) -> None:
    if key in ("seed", "record_id"):
        raise SceneError(f"vary {key}: every member has its own anyway; leave it out")
    if callable(how):
        return
    if isinstance(now, bool | dict | list) or (isinstance(now, str) and not _RATIO.fullmatch(now)):
        raise SceneError(f"vary {key}: is no number; name a key that holds one")
    low, high = how
    if not (math.isfinite(low) and math.isfinite(high) and low <= high):
        raise SceneError(f"vary {key}: the range {low:g} to {high:g} is empty; give the lower end first")
    if isinstance(now, int) and not (float(low).is_integer() and float(high).is_integer()):
        raise SceneError(f"vary {key}: takes whole numbers; give whole ends, not {low:g} and {high:g}")


def _drawn(chance: np.random.Generator, how: Range, now: Any) -> float | int | Fraction:
    low, high = how
    if isinstance(now, int):
        return int(chance.integers(int(low), int(high), endpoint=True))
    drawn = float(chance.uniform(low, high))
    # rates are ratios of whole numbers, and a double is one with too long a denominator
    return Fraction(drawn).limit_denominator(10**9) if isinstance(now, str) else drawn


class Member(NamedTuple):
    """One member of an ensemble, simulated."""

    number: int  # Counted from 1
    record: "xr.DataTree"
    truth: "xr.DataTree"  # As `simulate` gives them; the truth's attribute ``scene`` is the member's own scene


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
        Processes. With more than one, a script must have its work under ``if __name__ == "__main__":``.

    Returns
    -------
    iterator of Member
        (number, record, truth), in order, made as they are asked for, no more than two to a worker ahead.

    Raises
    ------
    SceneError
        As `simulate`; for a key or range that cannot be meant, at once.
    UsageError, WorkerError
        If there is no worker, or one dies.

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
    pairs = in_order(simulated, member_scenes(scene, members, seed=seed, vary=vary), min(workers, members))
    return (Member(number, to_tree(record), to_tree(truth)) for number, (record, truth) in enumerate(pairs, start=1))


class Written(NamedTuple):
    """What became of an ensemble."""

    manifest: Path  # Table of the members: number, seed, what varies, names of the files
    made: int
    kept: int  # Members whose files were there already


def write_ensemble(
    scene: Scene, members: int, folder: str | os.PathLike[str], *, name: str | None = None, seed: int | None = None,
    vary: Vary | None = None, workers: int = 1, overwrite: bool = False,
    progress: Callable[[int, int], object] | None = None,
) -> Written:  # fmt: skip
    """Simulate many members of a scene to files ``NAME-0001.record.nc``, ``NAME-0001.truth.nc``, ...

    Bit for bit what `simulate_ensemble` gives. A member whose two files are there, whole and of the same scene, stays:
    after an interrupt the same call goes on. The table ``NAME.ensemble.csv`` is written with the first.

    Parameters
    ----------
    scene, members, seed, vary, workers
        As `simulate_ensemble`.
    folder
        Of all files; it must exist.
    name
        What their names begin with; the scene's record_id if left out.
    overwrite
        Make all members anew, whatever is there.
    progress
        Called with how many members are done, and of how many.

    Raises
    ------
    SceneError, UsageError, WorkerError
        As `simulate_ensemble`; for keys, ranges and members' values that cannot be meant, before any work.
    FileError
        As `data_schemas.write`; and if a file is there that is not this member's, before any work.
    """
    name = scene.record_id if name is None else name
    manifest = Path(folder) / f"{name}.ensemble.csv"
    jobs = [
        (one, Path(folder) / f"{name}-{number:04d}.record.nc", Path(folder) / f"{name}-{number:04d}.truth.nc")
        for number, one in enumerate(member_scenes(scene, members, seed=seed, vary=vary), start=1)
    ]
    missing = [job for job in jobs if overwrite or not _is_made(*job)]
    kept = len(jobs) - len(missing)
    table = _table(jobs, list(vary or {}))
    for done, _ in enumerate(in_order(_write, missing, min(workers, max(1, len(missing)))), start=kept + 1):
        if done == kept + 1:  # before the first is there, a table would speak of nothing
            write_text(table, manifest, overwrite=True)
        if progress is not None:
            progress(done, len(jobs))
    if not missing:
        write_text(table, manifest, overwrite=True)
    return Written(manifest, len(missing), kept)


def _write(job: _Job) -> None:
    # what is there may be replaced: it is half of this member, or the caller said so
    simulate_to(*job, overwrite=True)


def _is_made(scene: Scene, record: Path, truth: Path) -> bool:
    """Whether both files of a member are there, whole and of its scene; `FileError` if one is something else."""
    there = 0
    wanted = (record, "history", history(scene)), (truth, "scene", scene.model_dump_json())
    for path, attribute, content in wanted:
        if not path.exists():
            continue
        try:
            contents, _ = skim(path)
        except FileError as error:
            raise FileError(f"{error}; or give --force (overwrite=True) to make it anew") from None
        if contents[""].attrs.get(attribute) != content:
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
    for number, (scene, record, truth) in enumerate(jobs, start=1):
        table.writerow([number, scene.seed, *(value(scene, key) for key in keys), record.name, truth.name])
    return text.getvalue()


def in_order(function: Callable[[Job], Result], jobs: Iterable[Job], workers: int) -> Iterator[Result]:
    """Results of a module's function for each job, in order; no more than two jobs to a worker are ahead of them.

    With one worker all is done in this process. `UsageError` at once if there is none, `WorkerError` if one dies.
    """
    if workers < 1:
        raise UsageError(f"workers = {workers}: give 1 or more")
    return map(function, jobs) if workers == 1 else _spread(function, jobs, workers)


def _spread(function: Callable[[Job], Result], jobs: Iterable[Job], workers: int) -> Iterator[Result]:
    """As `in_order`, in processes."""
    ahead: deque[Future[Result]] = deque()
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=_begin)
    try:
        for job in jobs:
            ahead.append(pool.submit(_run, function, job))
            if len(ahead) == 2 * workers:
                yield ahead.popleft().result()
        while ahead:
            yield ahead.popleft().result()
    except BrokenProcessPool:
        raise WorkerError(
            "a worker process died before it was done; run the same again, with fewer workers if memory is short (in a "
            "script, start it under: if __name__ == '__main__')"
        ) from None
    finally:
        working = [*(pool._processes or {}).values()]
        for process in working:  # on what nobody waits for any more
            process.terminate()
        for process in working:  # told in the middle of taking a job, it may miss that, or leave it locked to others
            process.join(_PATIENCE)
            process.kill()
        pool.shutdown(cancel_futures=True)


def _run(function: Callable[[Job], Result], job: Job) -> Result:
    """One job; a worker that is ended leaves: the executor would take that for an answer, and give it the next."""
    try:
        return function(job)
    except SystemExit:
        os._exit(0)


def _begin() -> None:
    """Of a worker: Ctrl-C reaches all, but who started it ends it, and in order: nothing half-written stays."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)


def _leave(*_: object) -> None:
    """End, once: the executor tells all a second time when one has gone, while others still clear away."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    sys.exit()
