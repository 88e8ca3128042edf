"""`result.isochrony`: a result as a person asks for it, on the tree that xarray holds."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, Any

import xarray as xr

from pipeline.flag_words import told
from pipeline.summary import summaries

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

SHOWN = ("method", "gravity_m_s2", "gravity_sigma_mgal", "uncorrected_m_s2", "status")


@xr.register_datatree_accessor("isochrony")
class Isochrony:
    """Of a DataTree with the layout "isochrony-result"; it is there once `pipeline` was used, or this is imported.

    Examples
    --------
    >>> result = xr.DataTree(name="any")
    >>> type(result.isochrony).__name__
    'Isochrony'
    """

    def __init__(self, tree: xr.DataTree) -> None:
        self._tree = tree

    def summary(self) -> list[dict[str, Any]]:
        """One dictionary for each method: the JSON objects of the command line."""
        return summaries(self._tree)

    def table(self) -> pd.DataFrame:
        """One row for each method; further results can be put beneath it with `pandas.concat`."""
        import pandas as pd

        return pd.DataFrame(self.summary()).set_index(["record_id", "method"])

    def plot(self, *, true_gravity: float | None = None) -> Figure:
        """The picture of `isochrony plot`."""
        from pipeline.plots.result import result_figure

        return result_figure(self._tree, true_gravity=true_gravity)

    def _repr_html_(self) -> str:
        rows = self.summary()
        head = "".join(f"<th>{html.escape(name)}</th>" for name in SHOWN)
        body = "".join(
            f"<tr>{''.join(f'<td>{html.escape(str(row.get(name)))}</td>' for name in SHOWN)}</tr>" for row in rows
        )
        flags = dict.fromkeys(flag for row in rows for flag in row["flags"])
        words = "".join(f"<li><b>{html.escape(flag)}</b>: {html.escape(told(flag))}</li>" for flag in flags)
        best = next((row for row in reversed(rows) if row["gravity_m_s2"] is not None), None)
        lead = "no gravity"
        if best is not None:
            band = f"g = {best['gravity_m_s2']:.8f} ± {best['gravity_sigma_mgal'] * 1e-5:.8f} m/s²"
            lead = f"{band} by {html.escape(str(best['method']))}"
        name = html.escape(str(self._tree.attrs.get("record_id", "")))
        return f"<p><b>{name}</b>: {lead}</p><ul>{words}</ul><table><tr>{head}</tr>{body}</table>"
