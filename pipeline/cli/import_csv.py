"""`isochrony import`: columns of time and angle become a record."""

from __future__ import annotations

import argparse
from pathlib import Path

import data_schemas
from pipeline.cli.outputs import make_folder, place, refuse_clashes
from pipeline.cli.parser import add_meaning_options, one_of, pairs, periods

HELP = "turn columns of time and angle into a record"
DESCRIPTION = """\
Turn a text table into a record (netCDF).

With no options the first column is time in s and every other a trace of angles in rad. Comma, semicolon,
tab or blanks separate; a header is recognised; `#` starts a comment; empty, NaN, NA or - is a missing value;
a decimal comma is understood unless the comma separates. Times are numbers of seconds or ISO dates; they must
increase but need not be uniform. A trace labelled 1 is pendulum 1, a trace labelled 1-2 the difference of
pendulums 1 and 2. Period (full, at infinitesimal arc) and gravity may be left out only for a single trace."""

EXAMPLES = """\
examples:
  isochrony import swing.csv                                  one pendulum, nothing known of it
  isochrony import ship.csv --column left:1 --column film:1-2 --unit mm --lever 2000
                            --period 1=1.0099 --period 2=1.0100 --gravity 9.81
  isochrony import a.csv --time clock --column 3:upper --combination upper=1-2 --column 2:1 ..."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """List the options."""
    add = parser.add_argument
    add("table", metavar="CSV", help="text table")
    add("--time", default="", metavar="NAME", help="time column, by name or number from 1 (default the first)")
    columns = "column to import, by name or number from 1, and its trace (default all); repeatable"
    add("--column", action="append", default=[], metavar="NAME[:TRACE]", help=columns)
    add_meaning_options(parser, "optical lever, with --unit mm")
    units = "rad (default), deg, or mm on the film"
    add("--unit", type=one_of("unit", ("rad", "deg", "mm")), default="rad", metavar="UNIT", help=units)
    add("-o", dest="out", metavar="PATH", help="record file, or folder (ends with /); default beside the table")
    add("--force", action="store_true", help="overwrite an existing record")


def run(options: argparse.Namespace) -> int:
    """Import the table and write the record."""
    from pipeline.importing import ImportOptions, import_csv

    path = Path(options.table)
    output = place([path], options.out, ".record.nc")[0]
    refuse_clashes([path], [output], force=options.force)
    meaning = ImportOptions(
        time=options.time,
        columns=tuple(options.column),
        unit=options.unit,
        lever=options.lever,
        periods=periods("import", options.period),
        gravity=options.gravity,
        combinations=pairs("import", "--combination", options.combination),
    )
    record = import_csv(path, meaning)
    make_folder(output)
    data_schemas.write(record, output, overwrite=options.force)
    traces = ", ".join(str(label) for label in record["record"].dataset["trace"].values)
    time = record.dataset["time"].values
    print(f"{output}: {time.size} samples of {traces} over {time[-1]:.6g} s")
    return 0
