"""What `batch` tells: the plan of a dry run, and what became of everything at the end."""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from data_schemas.contents import shown
from pipeline.batch.campaign import Job, Tally
from pipeline.batch.config import Config
from pipeline.batch.ledger_index import NAME, Index
from pipeline.batch.log import Log
from pipeline.batch.resume import holds

_MOST_TOLD = 10  # faults on stderr; the summary has all
_LONGEST = 4096  # letters of a path


def tell_plan(jobs: Sequence[Job], folder: Path, versions: str, options: argparse.Namespace) -> int:
    """Say of each input whether it would be done, at most `--limit` of them; nothing is made or changed."""
    known = Index(folder, versions) if os.path.exists(folder / NAME) else None
    done = kept = 0
    for path, config in jobs:
        held = not options.force and known is not None and holds(path, config, known, retry_failed=options.retry_failed)
        waits = not held and options.limit is not None and done >= options.limit
        done, kept = done + (not held and not waits), kept + held
        what = "keep" if held else "wait" if waits else "do"
        print(f"{what}  {shown(path, _LONGEST)} -> {shown(config.output, _LONGEST)}", flush=True)
    print(f"{done} to do, {kept} to keep, {len(jobs) - done - kept} to wait")
    return 0


def tell_end(jobs: Sequence[Job], ledger: Index, folder: Path, tally: Tally, log: Log, *, as_json: bool) -> int:
    """Say what became of everything; return the exit status."""
    if as_json:
        for path, config in jobs:
            if config.key in ledger.places:
                _print_json(path, config, ledger)
    counts = Counter(ledger.places[config.key].status for _, config in jobs if config.key in ledger.places)
    bad = [config.key for _, config in jobs if config.key in ledger.places and ledger.places[config.key].status != "ok"]
    for key in bad[:_MOST_TOLD]:
        print(f"isochrony: {ledger.line(key)['error']}", file=sys.stderr)
    if len(bad) > _MOST_TOLD:
        print(f"isochrony: and {len(bad) - _MOST_TOLD} more, see {folder / 'summary.csv'}", file=sys.stderr)
    left = tally.total - counts.total()
    text = ", ".join(f"{counts[status]} {status}" for status in ("ok", "refused", "failed") if counts[status])
    log.event("end", done=tally.done, kept=tally.kept, left=left, **counts)
    if not as_json:
        waiting = f"; {left} left for --resume" if left else ""
        print(f"{folder / 'summary.csv'}: {text or 'nothing'} of {tally.total} inputs, {tally.kept} kept{waiting}")
    if counts["ok"] == tally.total - left:
        return 0
    return 1 if counts["ok"] else 3


def _print_json(path: Path, config: Config, ledger: Index) -> None:
    """The objects that `process` prints, read back from the result."""
    import data_schemas
    from pipeline.cli.summary_rows import failure, in_order
    from pipeline.cli.tables import print_json
    from pipeline.summary import summaries

    line: dict[str, Any] = ledger.line(config.key)
    if line["output_sha256"] is None:
        print_json(failure(path, ",".join(config.method), line["status"], line["error"]))
        return
    for row in summaries(data_schemas.read(config.output)):
        print_json(in_order({**row, "input": str(path), "output": str(config.output)}))
