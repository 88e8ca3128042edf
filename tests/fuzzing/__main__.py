"""Coverage-guided fuzzing of a target in resumable pieces: `python tests/fuzzing TARGET FOLDER`; needs atheris.

The folder carries, for each target, the corpus, the findings (an input named by its hash, and beside it the traceback,
or the log of the process that it ended) and how much processor time was spent. Each call spends one piece of the time
that remains.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path

PIECE, WHOLE = 30.0, 120.0
"""Minutes of processor time."""
MODULES = ("data_schemas", "pipeline", "synth.film", "synth.motion", "tomllib", "tifffile", "PIL", "h5py")
INPUTS, COVERED = (re.compile(each, re.MULTILINE) for each in (r"^#(\d+)\t", r"^#\d+\t(?!READ).*cov: (\d+)"))


def main() -> int:
    """Spend a piece of a target's time, in as many processes as findings ask for, and say what came of it."""
    parser = argparse.ArgumentParser(prog="python tests/fuzzing", description=__doc__)
    parser.add_argument("target", choices=("hdf5", "film", "csv", "toml"))
    parser.add_argument("folder", type=Path, help="carries corpus, findings and time spent from piece to piece")
    parser.add_argument("--piece", type=float, default=PIECE, metavar="MINUTES", help="of this call (%(default)g)")
    parser.add_argument("--whole", type=float, default=WHOLE, metavar="MINUTES", help="of all calls (%(default)g)")
    parser.add_argument("--child", type=float, metavar="SECONDS", help=argparse.SUPPRESS)
    options = parser.parse_args()
    folder = options.folder / options.target
    if options.child is not None:
        fuzz(options.target, folder, options.child)
    for name in ("corpus", "findings"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    note = folder / "spent"
    spent = float(note.read_text()) if note.exists() else 0.0
    left = min(60.0 * options.piece, 60.0 * options.whole - spent)
    runs = 0
    covered: list[int] = []
    while left > 1.0:
        used, ran, grown = piece(options, folder, left)
        left, spent, runs, covered = left - used, spent + used, runs + ran, covered + grown
        note.write_text(f"{spent:.1f}\n")
    findings = sorted(each.name for each in (folder / "findings").iterdir() if not each.suffix)
    first, last = (covered[0], covered[-1]) if covered else (0, 0)
    print(
        f"{options.target}: {runs} inputs, coverage {first} -> {last}, {len(list((folder / 'corpus').iterdir()))} in "
        f"the corpus, {len(findings)} findings, {spent / 60.0:.1f} minutes spent, "
        f"{max(0.0, options.whole - spent / 60.0):.1f} remain"
    )
    for name in findings:
        print(folder / "findings" / name)
    return 1 if findings else 0


def piece(options: argparse.Namespace, folder: Path, seconds: float) -> tuple[float, int, list[int]]:
    """Processor time, inputs and coverage of one process, which ends at its time or at an input that ends it."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    words = [sys.executable, os.path.dirname(os.path.abspath(__file__)), options.target, str(options.folder)]
    log = folder / "log"
    with log.open("wb") as output:
        ended = subprocess.run([*words, "--child", str(seconds)], stdout=output, stderr=output, check=False).returncode
    said = log.read_text(errors="replace")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    inputs = INPUTS.findall(said)
    if ended and not inputs:
        raise SystemExit(f"the fuzzer did not start:\n{said[-2000:]}")
    for kept in (folder / "findings").glob("*-*"):  # as libFuzzer names them
        name = kept.rename(kept.with_name(hashlib.sha256(kept.read_bytes()).hexdigest()[:16]))
        name.with_suffix(".txt").write_text(said[-8000:])
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return used, int(inputs[-1]) if inputs else 0, [int(each) for each in COVERED.findall(said)]


def fuzz(target: str, folder: Path, seconds: float) -> None:
    """Fuzz in this process, never to return; an exception is written down, once for each place, and passed over."""
    import atheris

    scratch = tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None)
    room = Path(scratch.name)
    with atheris.instrument_imports(include=[*MODULES]):
        from fuzz_targets import BYTES, SECONDS, TARGETS

        import data_schemas.shield

        chosen = TARGETS[target]
        for seed in chosen.seeds(room):
            (folder / "corpus" / hashlib.sha256(seed).hexdigest()[:16]).write_bytes(seed)
            chosen(room, seed)  # imports what is imported when it is needed
    places: set[str] = set()
    runs = 0

    def one(data: bytes) -> None:
        nonlocal runs
        runs += 1
        try:
            chosen(room, data)
        except Exception as fault:
            where = f"{type(fault).__name__} {traceback.extract_tb(fault.__traceback__)[-1]}"
            if where not in places:
                places.add(where)
                found = folder / "findings" / hashlib.sha256(data).hexdigest()[:16]
                found.write_bytes(data)
                found.with_suffix(".txt").write_text(traceback.format_exc())
        if time.process_time() > seconds:
            print(f"#{runs}\tEND", file=sys.stderr, flush=True)
            scratch.cleanup()
            os._exit(0)

    def changed(data: bytes, most: int, seed: int) -> bytes:
        return chosen.seal(atheris.Mutate(data, most))[:most]

    warnings.simplefilter("error")  # as in tests
    words = [
        sys.argv[0],
        str(folder / "corpus"),
        f"-artifact_prefix={folder / 'findings'}/",
        f"-timeout={SECONDS:.0f}",
        "-rss_limit_mb=0",
        "-max_len=16384",
    ]
    atheris.Setup(words, one, custom_mutator=changed)
    with data_schemas.shield.bounded(BYTES):
        atheris.Fuzz()


if __name__ == "__main__":
    sys.exit(main())
