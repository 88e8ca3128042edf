"""Three pendulums and more: every neighbouring pair is a fictitious pendulum, and all of them tell one gravity.

The pairs share readings (the middle pendulum's, where single pendulums are recorded) and the ledger's stated inputs;
each has its own ratio of periods. Weights are those of least squares under the covariance of reading noise and ratios.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.arrays import Floats
from pipeline.ledger.entry import MGAL
from pipeline.observation import noise_covariance

if TYPE_CHECKING:
    from xarray import DataTree

OWN = ("non_isochronism", "base_tie")
"""Entries whose uncertainty a pair does not share with the others."""
LEAST = 1e-9  # mGal, of noise: none at all would divide by zero


def neighbours(record: DataTree) -> list[str]:
    """Pairs of a record of three pendulums or more, as "1-2", "2-3"; fewer pendulums have none."""
    labels = [str(label) for label in record["record"].dataset["pendulum"].values]
    return [f"{one}-{two}" for one, two in itertools.pairwise(labels)] if len(labels) > 2 else []


def join(record: DataTree, reduce: Callable[[str], DataTree]) -> DataTree | None:
    """Reduce all neighbouring pairs of a record and weigh their gravities.

    Parameters
    ----------
    record : DataTree
        Layout "isochrony-record".
    reduce : callable
        Result of one pair.

    Returns
    -------
    DataTree or None
        The group `joint` of a result; None where there are not two pairs.
    """
    from xarray import Dataset, DataTree

    from data_schemas.variables import attributes

    pairs = neighbours(record)
    if len(pairs) < 2:
        return None
    results = [reduce(pair) for pair in pairs]
    found = joined(results, noise_covariance(record, pairs))
    dims = {"gravity": ("method",), "gravity_sigma": ("method",), "consistency": ("method",)}
    variables = {
        name: (dims.get(name, ("method", "pair")), values, attributes(f"joint/{name}"))
        for name, values in found.items()
    }
    methods = results[0]["gravity"]["method"]
    labels = ("pair", np.array(pairs, dtype=object), attributes("joint/pair"))
    return DataTree(Dataset(variables, coords={"method": methods.variable, "pair": labels}))


def joined(results: Sequence[DataTree], covariance: Floats) -> dict[str, Floats]:
    """Gravity of all pairs together, method by method.

    Parameters
    ----------
    results : sequence of DataTree
        One result a pair, of the same methods.
    covariance : (pairs, pairs) array
        Of the white reading noise of the pairs' differences, in any unit.

    Returns
    -------
    dict
        `gravity`, `gravity_sigma`, `consistency` (methods,): the weighted mean in m s-2, its 1 sigma in mGal, and the
        root of chi squared for each pair too many, about 1 where they agree. `pair_gravity`, `pair_sigma`, `weight`
        (methods, pairs). A pair that refused has weight 0; consistency needs two.
    """
    tables = [result["gravity"].dataset for result in results]

    def column(name: str) -> Floats:
        return np.stack([np.asarray(table[name].values, dtype=np.float64) for table in tables], axis=-1)

    own = [table["sigma"].sel(entry=list(OWN)).fillna(0.0).values for table in tables]
    specific = np.sqrt(np.stack([np.square(each).sum(axis=-1) for each in own], axis=-1))
    gravity, sigma, noise = column("gravity"), column("gravity_sigma"), column("noise_sigma")
    alike = correlation(results) * covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    shape = gravity.shape
    mean, total, chi = np.full((3, shape[0]), np.nan)
    weight = np.zeros(shape)
    for row in range(shape[0]):
        good = np.isfinite(gravity[row]) & np.isfinite(sigma[row])
        if not good.any():
            continue
        values, of = gravity[row, good], np.ix_(good, good)
        quiet = np.maximum(noise[row, good], LEAST)
        matrix = alike[of] * np.outer(quiet, quiet) + np.diag(specific[row, good] ** 2 + LEAST**2)
        share = np.linalg.solve(matrix, np.ones(len(values)))
        share /= share.sum()
        common = np.sqrt(np.maximum(sigma[row, good] ** 2 - noise[row, good] ** 2 - specific[row, good] ** 2, 0.0))
        mean[row] = values[0] + share @ (values - values[0])
        total[row] = np.sqrt(share @ matrix @ share + (share @ common) ** 2)
        weight[row, good] = share
        if len(values) > 1:
            apart = (values - mean[row]) / MGAL
            chi[row] = np.sqrt(apart @ np.linalg.solve(matrix, apart) / (len(values) - 1))
    return {
        "gravity": mean,
        "gravity_sigma": total,
        "consistency": chi,
        "pair_gravity": gravity,
        "pair_sigma": sigma,
        "weight": weight,
    }


def correlation(results: Sequence[DataTree]) -> Floats:
    """How alike the pairs' frequencies answer to one and the same noise, (pairs, pairs).

    Noise moves the phase of a difference by its part in quadrature: two differences whose phases are apart by delta
    answer with cos delta; a slope weighs instants by the square of their distance from the middle.
    """
    times = np.asarray(results[0]["time"].values, dtype=np.float64)
    phases = []
    for result in results:
        phase = np.asarray(result["phases"].dataset["phase"].values[-1], dtype=np.float64)
        present = np.isfinite(phase)
        own = np.asarray(result["time"].values, dtype=np.float64)[present]
        phases.append(np.interp(times, own, phase[present]))
    weight = np.square(times - times.mean())
    turned = np.exp(1j * np.stack(phases))
    return np.asarray(((turned * weight) @ turned.conj().T).real / weight.sum())
