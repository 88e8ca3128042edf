"""The recipe: a record in, a result out."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from data_schemas.errors import RecordError, UsageError
from pipeline import methods
from pipeline.observation import observe

if TYPE_CHECKING:
    from xarray import DataTree


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
        if name != "auto":
            methods.method(name)
    if not gain_uncertainty >= 0.0:
        raise UsageError(f"gain_uncertainty: {gain_uncertainty} is not a relative uncertainty; give 0 or more")
    faults = check(record, "record")
    if faults:
        raise RecordError("; ".join(faults))
    if record["record"].sizes["trace"] == 1 and pair is None:
        from pipeline.period.result import period_result

        return period_result(record, requested, started)
    from pipeline.reduction import reduce_by
    from pipeline.result import build_result
    from pipeline.sensors.examination import examine

    found = examine(observe(record, pair))
    reductions = [reduce_by(name, found.prepared, gain_uncertainty, found) for name in requested]
    result = build_result(record, found.prepared, reductions, started)
    result.attrs.update(found.attributes)
    if pair is None and record["record"].sizes["pendulum"] > 2:
        from pipeline.pairs import join

        def reduce(each: str) -> DataTree:
            done = f"{found.prepared.observation.first}-{found.prepared.observation.second}" == each
            return result if done else process(record, method=method, pair=each, gain_uncertainty=gain_uncertainty)

        result["joint"] = join(record, reduce)
    return result
