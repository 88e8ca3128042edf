"""`isochrony explain`: what a flag means and what to do."""

from __future__ import annotations

import argparse

from pipeline.cli.parser import one_of
from pipeline.flag_words import FLAGS

HELP = "what a flag means"
DESCRIPTION = "Tell what a flag of a result means, and what to do about it; without a name all of them."
EXAMPLES = """\
examples:
  isochrony explain
  isochrony explain apparatus-fault"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """List the options."""
    parser.add_argument("flag", metavar="FLAG", nargs="?", type=one_of("flag", FLAGS), help="its name")


def run(options: argparse.Namespace) -> int:
    """Print the words."""
    for name in FLAGS if options.flag is None else (options.flag,):
        meaning, remedy, blocks = FLAGS[name]
        blocked = f"\n  process refuses records that bear it, unless --accept {name} is given" if blocks else ""
        print(f"{name}\n  {meaning}\n  remedy: {remedy}{blocked}")
    return 0
