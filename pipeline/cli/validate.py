"""`isochrony validate`: name every fault of a file at once."""

from __future__ import annotations

import argparse

import data_schemas
from data_schemas.errors import naming
from pipeline.cli.faults import exit_status

HELP = "name every fault of a file"
DESCRIPTION = """\
Check files against their schema: records, truths, results (netCDF) and scenes (TOML).

Each file gets one line "NAME: good", or one line for every fault with its remedy: layout, dimensions, types,
units, times that do not increase, values that cannot be, content that does not match its checksum."""

EXAMPLES = """\
examples:
  isochrony validate ship.record.nc
  isochrony validate ship.toml *.nc

exit status: 0 all good; 1 some good; 3 none good"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """List the options."""
    parser.add_argument("files", metavar="FILE", nargs="+", help="scene, record, truth or result")


def run(options: argparse.Namespace) -> int:
    """Check each file; the exit status says whether all, some or none are good."""
    good = 0
    for name in options.files:
        faults = data_schemas.validate(name)
        for fault in faults:
            print(naming(name, fault), flush=True)
        if not faults:
            print(f"{name}: good", flush=True)
            good += 1
    return exit_status(good, len(options.files))
