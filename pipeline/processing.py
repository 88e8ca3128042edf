"""The recipe: a record in, a result out."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
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


_JOINTLY = ("auto", "joint")


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
        From `pipeline.METHODS`; `auto` is `joint`.
    pair : str, optional
        "A-B": which two of the record's pendulums form the difference. Without it the first difference that is recorded
        is taken. The joint fit takes all pendulums in any case; of these two it lends the path.
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
        if name not in _JOINTLY:
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

    others = [name for name in requested if name not in _JOINTLY]
    joint = None
    if len(others) < len(requested):
        joint = _joint(record, pair, gain_uncertainty, alone=not others)
    prepared, found = _by_pair(record, others, pair, gain_uncertainty, spare=joint)
    if joint is not None:
        found |= {name: replace(joint.reduction, requested=name) for name in _JOINTLY}
    result = build_result(record, prepared, [found[name] for name in requested], started)
    if joint is not None and joint.reduction.gravity is not None:
        result["course"] = joint.course(np.asarray(result.dataset["time"].values))
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


def _by_pair(
    record: DataTree, names: Sequence[str], pair: str | None, gain_uncertainty: float, spare: Joint | None
) -> tuple[Prepared, dict[str, Reduction]]:
    """The methods that look at one difference; a record that cannot be prepared for them lends the joint fit's path."""
    from pipeline.prepared import prepare
    from pipeline.reduction import Reduction, reduce_by

    path = None if spare is None else spare.prepared
    if not names and path is not None:
        return path, {}
    started = time.perf_counter()
    try:
        prepared = prepare(observe(record, pair))
    except RefusedError as refusal:
        if path is None:
            raise
        elapsed = time.perf_counter() - started
        return path, {name: Reduction(name, name, "", None, None, (), str(refusal), elapsed) for name in names}
    return prepared, {name: reduce_by(name, prepared, gain_uncertainty) for name in names}
