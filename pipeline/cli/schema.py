"""`isochrony schema`: the layout of each file kind as JSON Schema."""

from __future__ import annotations

import argparse
import json

import data_schemas
from pipeline.cli.parser import one_of

_NAMES = ("scene", "record", "truth", "result", "film-truth", "summary")

HELP = "print the layout of a file kind"
DESCRIPTION = """\
Print the JSON Schema of a file kind: every field with its unit, its range and its meaning.

scene describes the TOML file; record, truth, result, film-truth and summary (of a batch) describe the netCDF files,
group by group."""

EXAMPLES = """\
examples:
  isochrony schema scene
  isochrony schema record > record.schema.json"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """List the options."""
    parser.add_argument("name", metavar="NAME", type=one_of("schema", _NAMES), help=", ".join(_NAMES))


def run(options: argparse.Namespace) -> int:
    """Print the schema."""
    print(json.dumps(data_schemas.json_schema(options.name), indent=2, ensure_ascii=False))
    return 0
