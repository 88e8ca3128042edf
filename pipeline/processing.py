"""The recipe: a record in, a result out."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from data_schemas.errors import RecordError, RefusedError, UsageError
from pipeline import methods
from pipeline.observation import observe

if TYPE_CHECKING:
    from xarray import DataTree

    from pipeline.joint.reduction import Joint
    from pipeline.prepared import Prepared
    from pipeline.reduction import Reduction


def process(
    record: DataTree,
    *,
    method: str | Sequence[str] = "auto",
    pair: str | None = None,
    gain_uncertainty: float = 0.0,
) -> DataTree:
    """Reduce a record to gravity by one or several methods; a single trace to its period.

    Parameters
    ----------
    record : DataTree
        Layout "isochrony-record"; it is not modified.
    method : str or sequence of str
        From `pipeline.METHODS`.
    pair : str, optional
        "A-B": which two of the record's pendulums form the difference. Without it the first difference that is recorded
        is taken; of three pendulums and more all neighbouring pairs are reduced too, and weighed (group `joint`).
    gain_uncertainty : float
        Relative 1-sigma uncertainty of the first pendulum's scale.

    Returns
    -------
    DataTree
        Layout "isochrony-result". A method that refuses the record is in it with its reason and no value.

    Raises
    ------
    RecordError
        The record breaks its layout, or cannot give a difference.
    RefusedError
        No method can use it.
    UsageError
        A name that is not a method or pair, or a negative uncertainty.
    """
    from data_schemas import check

    started = time.perf_counter()
    requested = [method] if isinstance(method, str) else list(method)
    for name in requested:
        if name not in ("auto", "joint"):
            methods.method(name)
    if not gain_uncertainty >= 0.0:
        raise UsageError(f"gain_uncertainty: {gain_uncertainty} is not a relative uncertainty; give 0 or more")
    faults = check(record, "record")
    if faults:
        raise RecordError("; ".join(faults))
    if record["record"].sizes["trace"] == 1 and pair is None:
        from pipeline.period.result import period_result

        return period_result(record, requested, started)
    from pipeline.result import build_result

    joint = _joint(record, pair, gain_uncertainty, alone=requested == ["joint"]) if "joint" in requested else None
    others = [name for name in requested if name != "joint"]
    prepared, reductions, attributes = _classical(record, others, pair, gain_uncertainty, spare=joint)
    if joint is not None:
        reductions.insert(requested.index("joint"), joint.reduction)
    result = build_result(record, prepared, reductions, started)
    result.attrs.update(attributes)
    if joint is not None and joint.reduction.gravity is not None:
        result["course"] = joint.course(np.asarray(result.dataset["time"].values))
    if others and pair is None and record["record"].sizes["pendulum"] > 2:
        from pipeline.pairs import join

        def reduce(each: str) -> DataTree:
            done = f"{prepared.observation.first}-{prepared.observation.second}" == each and joint is None
            return result if done else process(record, method=others, pair=each, gain_uncertainty=gain_uncertainty)

        result["joint"] = join(record, reduce)
    return result


def _joint(record: DataTree, pair: str | None, gain_uncertainty: float, *, alone: bool) -> Joint:
    """All pendulums in one fit; beside other methods a refusal is a row."""
    from pipeline.joint.reduction import reduce_jointly, refused

    started = time.perf_counter()
    try:
        return reduce_jointly(record, pair, gain_uncertainty)
    except RefusedError as refusal:
        if alone:
            raise
        return refused(str(refusal), time.perf_counter() - started)


def _classical(
    record: DataTree, names: Sequence[str], pair: str | None, gain_uncertainty: float, spare: Joint | None
) -> tuple[Prepared, list[Reduction], Mapping[str, float]]:
    """The methods that look at one difference; a record that cannot be prepared for them lends the joint fit's path."""
    from pipeline.reduction import Reduction, reduce_by
    from pipeline.sensors.examination import examine

    path = None if spare is None else spare.prepared
    if not names and path is not None:
        return path, [], {}
    started = time.perf_counter()
    try:
        found = examine(observe(record, pair))
    except RefusedError as refusal:
        if path is None:
            raise
        elapsed = time.perf_counter() - started
        return path, [Reduction(name, name, "", None, None, (), str(refusal), elapsed) for name in names], {}
    return (
        found.prepared,
        [reduce_by(name, found.prepared, gain_uncertainty, found) for name in names],
        found.attributes,
    )
