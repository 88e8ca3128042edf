"""From a scene to a record and its truth."""

from __future__ import annotations

import xarray as xr

from data_schemas.scene import Scene
from synth.march import march
from synth.plan import plan
from synth.recording.clock import set_clock
from synth.recording.observe import observe
from synth.truth import reveal


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

    Examples
    --------
    >>> from data_schemas.scene import load_scene
    >>> from synth import scene_path
    >>> record, truth = simulate(load_scene(scene_path("demo")))
    >>> record["record/elongation"].sizes["time"]
    45000
    """
    clock = set_clock(scene)
    the_plan = plan(scene, clock)
    course = march(the_plan, clock)
    return observe(scene, clock, course), reveal(scene, clock, the_plan, course)
