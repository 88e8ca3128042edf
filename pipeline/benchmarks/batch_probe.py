"""Child of the suite `batch`: the loop that a user would write, and the instants at which its records were done."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import data_schemas
from pipeline.processing import process


def main(records: str, out: str, method: str) -> None:
    """Read, process and write every record of a folder; print the instants, s."""
    Path(out).mkdir()
    ends = []
    for path in sorted(Path(records).iterdir()):
        data_schemas.write(process(data_schemas.read(path), method=method), Path(out) / path.name)
        ends.append(time.perf_counter())
    print(json.dumps(ends))


if __name__ == "__main__":
    main(*sys.argv[1:])
