"""Child of the suite `leave-out`: process one file by one method; tell each stage's time and what was loaded."""

from __future__ import annotations

import json
import sys
import time


def main(path: str, methods: str) -> None:
    """Print one JSON object: seconds of each stage, and the modules loaded by them; methods are parted by commas."""
    before = set(sys.modules)
    stages = {}
    started = time.perf_counter()
    import data_schemas
    from pipeline.processing import process
    from pipeline.summary import summaries

    stages["import"] = time.perf_counter() - started
    started = time.perf_counter()
    record = data_schemas.read(path)
    stages["read"] = time.perf_counter() - started
    started = time.perf_counter()
    result = process(record, method=methods.split(","))
    summaries(result)
    stages["process"] = time.perf_counter() - started
    started = time.perf_counter()
    data_schemas.write(result, path + ".result.nc", overwrite=True)
    stages["write"] = time.perf_counter() - started
    print(json.dumps({"seconds": stages, "modules": sorted(set(sys.modules) - before)}))


if __name__ == "__main__":
    sys.modules["dask"] = None  # type: ignore[assignment]  # xarray imports it wherever it is; we must not
    main(*sys.argv[1:])
