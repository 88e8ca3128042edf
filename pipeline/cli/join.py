"""`isochrony join`: part records become one."""

from __future__ import annotations

import argparse
from pathlib import Path

import data_schemas
from pipeline.cli.faults import read_checked
from pipeline.cli.outputs import refuse_clashes

HELP = "part records put together"
DESCRIPTION = """\
Put records of the same pendulums together, one after the other: parts of a film that were read one by one, days of a
cruise. Parts may be named in any order; their times must not overlap, and count from the date in the units of their
time (start_time in a film's TOML). Constants of the instrument must be the same in all."""
EXAMPLES = """\
examples:
  isochrony join night-1.record.nc night-2.record.nc -o night.record.nc

exit status: 0 joined; 2 usage; 3 a part cannot be used"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """List the options."""
    parser.add_argument("parts", metavar="PART", nargs="+", help="record file (NAME.record.nc)")
    parser.add_argument("-o", dest="out", metavar="PATH", required=True, help="the record of all")
    parser.add_argument("--force", action="store_true", help="overwrite an existing record")


def run(options: argparse.Namespace) -> int:
    """Join the parts."""
    from pipeline.joining import join_records

    inputs, output = [Path(name) for name in options.parts], Path(options.out)
    refuse_clashes(inputs, [output], force=options.force)
    record = join_records([read_checked(path, "record") for path in inputs], [str(path) for path in inputs])
    data_schemas.write(record, output, overwrite=options.force)
    time = record.dataset["time"].values
    print(f"{output}: {len(inputs)} parts, {time.size} samples over {time[-1] - time[0]:.0f} s")
    return 0
