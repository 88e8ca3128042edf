"""The recipe: a record in, a result out."""

import os
import time
from collections.abc import Collection, Sequence
from dataclasses import replace

from xarray import Dataset, DataTree

from data_schemas import adopted
from data_schemas.checking import checked
from data_schemas.errors import RefusedError, UsageError
from data_schemas.layouts import REWRITTEN
from pipeline import methods
from pipeline.methods import Function
from pipeline.observation import observe
from pipeline.prepared import prepare
from pipeline.reduction import Reduction, of_film, reduce_by, refused
from pipeline.result import build_result, period_result

_JOINTLY = ("auto", "joint")


def process(
    record: DataTree | Dataset | str | os.PathLike[str], *, method: str | Function | Sequence[str | Function] = "auto",
    pair: str | None = None, gain_uncertainty: float = 0.0, full: bool = False, quantities: str = "all",
    accept: Collection[str] = (),
) -> DataTree:  # fmt: skip
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
    started = time.perf_counter()
    requested = [_named(each) for each in ([method] if isinstance(method, str) or callable(method) else method)]
    if not gain_uncertainty >= 0.0:
        raise UsageError(f"gain_uncertainty: {gain_uncertainty} is not a relative uncertainty; give 0 or more")
    if quantities not in ("all", "gravity"):
        raise UsageError(f"quantities: {quantities!r} is not known; give all or gravity")
    record = adopted(record)
    contents = checked(record, "record")
    raised = of_film(record, accept)
    if REWRITTEN in record.attrs:
        raised = (*raised, REWRITTEN)
    if record["record"].sizes["trace"] == 1 and pair is None:
        return period_result(record, contents, requested, started, raised)
    others = [name for name in requested if name not in _JOINTLY]
    joint, found = None, dict[str, Reduction]()
    if len(others) < len(requested):
        from pipeline.joint.reduction import reduce_jointly

        begun = time.perf_counter()
        try:
            joint = reduce_jointly(record, pair, gain_uncertainty)
            own = joint.reduction
        except RefusedError as refusal:
            if not others:
                raise
            own = refused("joint", refusal, begun)  # beside other methods a refusal is a row
        found |= {name: replace(own, requested=name) for name in _JOINTLY}
    prepared, begun = None, time.perf_counter()
    if others or joint is None:
        try:
            prepared = prepare(observe(record, pair))
            found |= {name: reduce_by(name, prepared, gain_uncertainty) for name in others}
        except RefusedError as refusal:
            if joint is None:
                raise
            found |= {name: refused(name, refusal, begun) for name in others}
    source = prepared
    if joint is not None and (prepared is None or not prepared.observation.whole):
        source = joint.prepared  # a record that cannot be prepared for others lends the joint fit's path
    assert source is not None  # without the joint fit nothing else is prepared
    reductions = [replace(found[name], flags=(*found[name].flags, *raised)) for name in requested]
    own_source = None if prepared is source else prepared
    bare = quantities == "gravity"
    return build_result(record, contents, source, own_source, reductions, joint, full=full, bare=bare, started=started)


def _named(method: str | Function) -> str:
    """Name of a method; a function becomes one."""
    if callable(method):
        name = str(getattr(method, "__name__", type(method).__name__))
        methods.register_method(name, method, words="a function that was given")
        return name
    if method not in _JOINTLY:
        methods.method(method)
    return method
