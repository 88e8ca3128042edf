"""`isochrony import`: columns of time and angle become a record."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from data_schemas.errors import UsageError
from pipeline.cli.files import place, refuse_clashes, store
from pipeline.cli.parser import number, pairs, periods


def run(options: argparse.Namespace) -> int:
    """Import the table and write the record."""
    from pipeline.importing.record import ImportOptions, import_csv

    path = Path(options.table)
    output = place([path], options.out, ".record.nc")[0]
    refuse_clashes([path], [output], force=options.force)
    constants = _instrument(options)
    stated, gravity = constants.pop("period", {}), constants.pop("reference_gravity", None)
    recorded = {"vertical_acceleration": options.heave, "horizontal_acceleration": options.horizontal}
    meaning = ImportOptions(
        time=options.time,
        columns=tuple(options.column),
        unit=options.unit or "",
        lever=options.lever,
        periods=(stated if isinstance(stated, dict) else {"": stated}) | periods("import", options.period),
        gravity=gravity if options.gravity is None else options.gravity,
        combinations=pairs("import", "--combination", options.combination),
        accelerations={name: column for name, column in recorded.items() if column is not None},
        position=options.xy,
        noise=options.noise,
        instrument=constants,
    )
    record = import_csv(path, meaning)
    store(record, output, force=options.force)
    traces = ", ".join(str(label) for label in record["record"].dataset["trace"].values)
    time = record.dataset["time"].values
    print(f"{output}: {time.size} samples of {traces} over {time[-1]:.6g} s")
    return 0


def _instrument(options: argparse.Namespace) -> dict[str, Any]:
    """Constants of the TOML file, and of options, which go before it."""
    from data_schemas.text_files import load_toml

    found: dict[str, Any] = {}
    if options.instrument is not None:
        found |= load_toml(options.instrument, "constants of an instrument", UsageError)
    damping = pairs("import", "--damping", options.damping)
    given = {
        "damping_rate": {label: number("--damping")(rate) for label, rate in damping.items()} or None,
        "latitude": options.latitude,
        "scale_uncertainty": options.scale,
        "zero_uncertainty": 0.0 if options.zero_known else None,
    }
    return found | {name: value for name, value in given.items() if value is not None}
