"""The recipe: a record in, a result out."""

from __future__ import annotations

import os
import time
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from data_schemas.errors import RecordError, RefusedError, UsageError
from data_schemas.layouts import REWRITTEN
from pipeline import methods
from pipeline.flags import of_film
from pipeline.observation import observe
from pipeline.reduction import Reduction, reduce_by

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

    from pipeline.joint.reduction import Joint
    from pipeline.methods import Function
    from pipeline.prepared import Prepared


_JOINTLY = ("auto", "joint")


def process(
    record: DataTree | Dataset | str | os.PathLike[str],
    *,
    method: str | Function | Sequence[str | Function] = "auto",
    pair: str | None = None,
    gain_uncertainty: float = 0.0,
    full: bool = False,
    quantities: str = "all",
    accept: Collection[str] = (),
) -> DataTree:
    """Reduce a record to gravity by one or several methods; a single trace to its period.

    Parameters
    ----------
    record : DataTree, Dataset or path
        Layout "isochrony-record"; it is not modified. Of a dataset of traces see `data_schemas.adopted`.
    method : str, callable or sequence of them
        From `pipeline.METHODS`, or registered; `auto` is `joint`. A function `Prepared -> Estimate` goes by its name.
    pair : str, optional
        "A-B": which two of the record's pendulums form the difference. Without it the first difference that is recorded
        is taken. The joint fit takes all pendulums in any case; of these two it lends the path.
    gain_uncertainty : float
        Relative 1-sigma uncertainty of the first pendulum's scale.
    full : bool
        Whether the pendulums' fitted angles at the record's own times are in the result too.
    quantities : str
        `all`, or `gravity` alone: no phases, corrections, course, difference and spectrum.
    accept : collection of str
        Flags of a film that make time or scale doubtful and shall not block; sigma holds the doubt.

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
        A name that is not a method, pair or choice of quantities, or a negative uncertainty.
    """
    from data_schemas import adopted, check

    started = time.perf_counter()
    requested = [_named(each) for each in ([method] if isinstance(method, str) or callable(method) else method)]
    if not gain_uncertainty >= 0.0:
        raise UsageError(f"gain_uncertainty: {gain_uncertainty} is not a relative uncertainty; give 0 or more")
    if quantities not in ("all", "gravity"):
        raise UsageError(f"quantities: {quantities!r} is not known; give all or gravity")
    record = adopted(record)
    faults = check(record, "record")
    if faults:
        raise RecordError("; ".join(faults))
    raised = of_film(record, accept)
    if REWRITTEN in record.attrs:
        raised = (*raised, REWRITTEN)
    if record["record"].sizes["trace"] == 1 and pair is None:
        from pipeline.period.result import period_result

        return period_result(record, requested, started, raised)
    from pipeline.result import Parts, build_result

    others = [name for name in requested if name not in _JOINTLY]
    joint, found = None, dict[str, Reduction]()
    if len(others) < len(requested):
        joint, own = _joint(record, pair, gain_uncertainty, alone=not others)
        found |= {name: replace(own, requested=name) for name in _JOINTLY}
    prepared, others_found = _by_pair(record, others, pair, gain_uncertainty, spare=joint)
    found |= others_found
    source = prepared if joint is None or (others and prepared.observation.whole) else joint.prepared
    own_of_pair = None if prepared is source else prepared
    reductions = [found[name] for name in requested]
    if raised:
        reductions = [replace(each, flags=(*each.flags, *raised)) for each in reductions]
    return build_result(Parts(record, source, own_of_pair, reductions, joint, full, quantities == "gravity"), started)


def _named(method: str | Function) -> str:
    """Name of a method; a function becomes one."""
    if callable(method):
        name = str(getattr(method, "__name__", type(method).__name__))
        methods.register_method(name, method, words="a function that was given")
        return name
    if method not in _JOINTLY:
        methods.method(method)
    return method


def _joint(
    record: DataTree, pair: str | None, gain_uncertainty: float, *, alone: bool
) -> tuple[Joint | None, Reduction]:
    """All pendulums in one fit; beside other methods a refusal is a row."""
    from pipeline.joint.reduction import reduce_jointly

    started = time.perf_counter()
    try:
        joint = reduce_jointly(record, pair, gain_uncertainty)
    except RefusedError as refusal:
        if alone:
            raise
        return None, _refused("joint", refusal, started)
    return joint, joint.reduction


def _refused(name: str, refusal: RefusedError, started: float) -> Reduction:
    return Reduction(name, name, "", None, None, (), str(refusal), time.perf_counter() - started)


def _by_pair(
    record: DataTree, names: Sequence[str], pair: str | None, gain_uncertainty: float, spare: Joint | None
) -> tuple[Prepared, dict[str, Reduction]]:
    """The methods that look at one difference; a record that cannot be prepared for them lends the joint fit's path."""
    from pipeline.prepared import prepare

    if not names and spare is not None:
        return spare.prepared, {}
    started = time.perf_counter()
    try:
        prepared = prepare(observe(record, pair))
    except RefusedError as refusal:
        if spare is None:
            raise
        return spare.prepared, {name: _refused(name, refusal, started) for name in names}
    return prepared, {name: reduce_by(name, prepared, gain_uncertainty) for name in names}
