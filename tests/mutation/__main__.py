"""Mutation testing: `python -m tests.mutation --seed 18 --part guard --number 50`.

One JSON line a mutant is appended to `--results`; what stands there is not tried again, but for survivors with
`--again`. At the end: what was killed, survived and timed out, and each survivor as the lines before and after.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import os
import tempfile
import time
from collections import Counter
from pathlib import Path

if __name__ == "__main__":  # before anything brings numba or NumPy
    os.environ |= {"NUMBA_DISABLE_JIT": "1", "OMP_NUM_THREADS": "1"}

from tests.mutation.mutants import Mutant, sample
from tests.mutation.parts import PARTS
from tests.mutation.running import KILLED, SURVIVED, TIMED_OUT, Scratch, warm_up


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("--seed", type=int, nargs="+", default=[18])
    parser.add_argument("--part", choices=PARTS, nargs="+", default=list(PARTS))
    parser.add_argument("--number", type=int, nargs="+", default=[50], help="of mutants a part, for each seed")
    parser.add_argument("--results", type=Path, default=Path("mutation.jsonl"), help="appended, and read to go on")
    parser.add_argument("--again", action="store_true", help="try survivors again")
    parser.add_argument(
        "--seconds", type=float, default=math.inf, help="of tests that a mutant is shown to, the fastest"
    )
    parser.add_argument("--tests", nargs="+", help="patterns of test files, instead of all of the part")
    chosen = parser.parse_args()
    warm_up()
    for name in chosen.part:
        with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
            part = PARTS[name]._replace(tests=chosen.tests) if chosen.tests else PARTS[name]
            scratch = Scratch(Path(folder), part)
            for seed, number in zip(chosen.seed, itertools.cycle(chosen.number), strict=False):
                run(name, scratch, sample(scratch.folder, scratch.files, seed, number), seed, chosen)


def run(name: str, scratch: Scratch, drawn: list[Mutant], seed: int, chosen: argparse.Namespace) -> None:
    """Try the mutants of one part that were not tried, and print what became of all."""
    outcomes = known(chosen.results)
    open_ = (None, SURVIVED) if chosen.again else (None,)
    left = [one for one in drawn if outcomes.get(one.identity) in open_]
    if left:
        scratch.survey()
    for number, one in enumerate(left, start=1):
        begun = time.monotonic()
        outcome, by = scratch.try_out(one, chosen.seconds)
        outcomes[one.identity] = outcome
        line = {"part": name, "seed": seed, "mutant": shown(scratch, one), "outcome": outcome, "by": by}
        line |= {"seconds": round(time.monotonic() - begun, 1), "identity": one.identity}
        with chosen.results.open("a") as file:
            file.write(json.dumps(line, ensure_ascii=False) + "\n")
        print(f"{name} {number}/{len(left)} {outcome} ({line['seconds']} s)", flush=True)
    counts = Counter(outcomes[one.identity] for one in drawn)
    for one in drawn:
        if outcomes[one.identity] == SURVIVED:
            print(shown(scratch, one))
    dead = counts[KILLED] + counts[TIMED_OUT]
    print(
        f"{name}, seed {seed}: {counts[KILLED]} killed, {counts[TIMED_OUT]} timed out, {counts[SURVIVED]} survived: "
        f"{100.0 * dead / max(len(drawn), 1):.0f} % of {len(drawn)}",
        flush=True,
    )


def shown(scratch: Scratch, one: Mutant) -> str:
    """The lines that a mutant changes."""
    return one.shown((scratch.folder / one.path).read_bytes())


def known(path: Path) -> dict[str, str]:
    """Outcomes by identity; the last line of a mutant counts."""
    lines = path.read_text().splitlines() if path.exists() else []
    return {one["identity"]: one["outcome"] for one in map(json.loads, lines)}


if __name__ == "__main__":
    main()
