"""From a scene to a record and its truth: in memory, or straight to files, chunk by chunk."""

import os
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from data_schemas.appending import Appended
from data_schemas.contents import Contents, Entry, Group, to_tree
from data_schemas.scene import Scene
from data_schemas.shield import shielded
from synth.plan import plan, propagate
from synth.recording.apparatus import Apparatus
from synth.recording.clock import Clock, set_clock
from synth.recording.observe import Unwrapping, observe, reveal

if TYPE_CHECKING:
    import xarray as xr

_Path = str | os.PathLike[str]


def stream(scene: Scene, clock: Clock) -> Iterator[tuple[Contents, Contents]]:
    """Record and truth of a scene, chunk by chunk in order of time; joined along it they are what `simulate` returns.

    Attributes are those of the last chunk. `SceneError` as `simulate`. Plain arrays: importing xarray takes long.
    """
    the_plan = plan(scene, clock)
    apparatus, unwrapped = Apparatus(the_plan, clock), Unwrapping()
    for part, sampled in propagate(the_plan, clock):
        yield observe(scene, part, sampled, apparatus), reveal(part, the_plan, sampled, unwrapped)


def simulated(scene: Scene) -> tuple[Contents, Contents]:
    """Record and truth of a scene as plain contents; what `simulate` makes trees of."""
    records, truths = zip(*stream(scene, set_clock(scene)), strict=True)
    return joined(records), joined(truths)


def joined(chunks: Sequence[Contents]) -> Contents:
    """Chunks of one content put together along time; what does not change with it, and attributes, of the last."""

    def whole(path: str, name: str, last: Entry) -> Entry:
        if "time" not in last.dims or len(chunks) == 1:
            return last
        values = np.concatenate([each[path].variables[name].values for each in chunks], axis=-1)
        return Entry(last.dims, values, last.attrs)

    return {
        path: Group(group.attrs, {name: whole(path, name, last) for name, last in group.variables.items()})
        for path, group in chunks[-1].items()
    }


def simulate(scene: Scene) -> "tuple[xr.DataTree, xr.DataTree]":
    """Simulate a scene; the same scene gives the same bits.

    Linear pendulums on a support that moves as a sum of harmonics have a solution in closed form, right to 1e-15 of the
    largest angle however long the record. Pendulums with the sine law are integrated by exponential Picard collocation,
    to 1e-14 in an hour at sea; the truth says what error is estimated.

    Parameters
    ----------
    scene
        As `data_schemas.load_scene` or `Scene.model_validate` give it.

    Returns
    -------
    record, truth : DataTree
        As `data_schemas` lays them out. Processing must read the record only.

    Raises
    ------
    SceneError
        A table is not there or too short, or a pendulum does not swing.

    Examples
    --------
    >>> from data_schemas.scene import load_scene
    >>> from synth import scene_path
    >>> record, truth = simulate(load_scene(scene_path("linear")))
    >>> record["record/elongation"].sizes["time"]
    45000
    """
    record, truth = simulated(scene)
    return to_tree(record), to_tree(truth)


def simulate_to(
    scene: Scene, record_path: _Path, truth_path: _Path, *, overwrite: bool = False,
    progress: Callable[[int, int], object] | None = None,
) -> int:  # fmt: skip
    """Simulate a scene straight to its two files, chunk by chunk; returns the number of samples of a trace.

    The files are those that `simulate` and `data_schemas.write` make, bit for bit, but no more than a chunk of them is
    ever in memory, beside the times of uneven or dropped samples (some tens of bytes each) and the motion where it is
    not the closed form (8 bytes a sample and state; twice that for a moment).

    Parameters
    ----------
    scene
        As `data_schemas.load_scene` or `Scene.model_validate` give it.
    record_path, truth_path
        Of the files to make; their folders must exist.
    overwrite
        Whether existing files may be replaced.
    progress
        Called with how many samples are done, and of how many, after every chunk.

    Raises
    ------
    SceneError
        As `simulate`.
    FileError
        As `data_schemas.write`. Whatever is raised, a KeyboardInterrupt too, nothing half-written stays, and older
        files stay as they were.

    Examples
    --------
    >>> import tempfile
    >>> from data_schemas.scene import load_scene
    >>> from synth import scene_path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     simulate_to(load_scene(scene_path("linear")), f"{folder}/linear.record.nc", f"{folder}/linear.truth.nc")
    45000
    """
    clock = set_clock(scene)
    done = 0
    with (
        Appended(record_path, clock.count, overwrite=overwrite) as record,
        Appended(truth_path, clock.count, overwrite=overwrite) as truth,
    ):
        for record_chunk, truth_chunk in stream(scene, clock):
            record.append(record_chunk)
            truth.append(truth_chunk)
            done += record_chunk[""].variables["time"].values.size
            if progress is not None:
                progress(done, clock.count)
        record.finish()
        truth.finish()
        with shielded():  # both or neither
            record.publish()
            truth.publish()
    return clock.count
