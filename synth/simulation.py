"""From a scene to a record and its truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

from data_schemas.contents import to_tree
from data_schemas.scene import Scene
from synth.streaming import simulated

if TYPE_CHECKING:
    import xarray as xr


def simulate(scene: Scene) -> tuple[xr.DataTree, xr.DataTree]:
    """Simulate a scene.

    Linear pendulums on a support that moves as a sum of harmonics have a solution in closed form; it is
    evaluated at every reading, right to 1e-15 of the largest angle however long the record. Pendulums with the sine
    law are integrated by exponential Picard collocation, to 1e-14 in an hour at sea; the truth says what error is
    estimated. The same scene gives the same bits.

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
        If the scene asks for what cannot be: a table that is not there or too short, a pendulum that does not
        swing.

    See Also
    --------
    synth.simulate_to : straight to files, in bounded memory.

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
