"""`isochrony batch`: thousands of records, unattended."""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial
from pathlib import Path
from typing import Any

from data_schemas.errors import FileError, UsageError
from pipeline.cli.parser import number, positive, processors
from pipeline.cli.process import add_reduction_options
from pipeline.cli.tables import complain, progress

HELP = "gravity from thousands of records"
DESCRIPTION = """\
Gravity from many inputs: records (.record.nc), folders and patterns of them, and scenes (.toml), which are
simulated first, alone or over a grid of values (--sweep, --repeat).

Into the folder of -o go one result an input, named as the input is below the inputs' common folder,
summary.csv and summary.nc with a row an input and method, ledger.jsonl, which knows what was done, and
batch.log.jsonl, which tells when. Interrupted or killed, the same command with --resume goes on: it keeps what
was made of the same input with the same settings and versions and is still as it was written; the summary is
then the same, bit by bit.

Every input is read and processed in a process of its own, which may hold --memory MiB and twelve times what the
input declares, for --timeout seconds: what crashes, hangs or deceives costs that input alone. --trusted lifts
the limit of memory; --executor serial, in this process, wants trusted inputs. --scheduler gives the work to a
dask cluster whose workers see the same files."""

EXAMPLES = """\
examples:
  isochrony batch cruises/ -o results              every *.record.nc below the folder
  isochrony batch 'cruises/*/day-*.record.nc' -o results --method projection --jobs 8
  isochrony batch cruises/ -o results --resume --retry-failed
  isochrony batch demo --sweep gravity=9.78:9.83:11 --repeat 20 -o campaign
  isochrony batch cruises/ -o results --scheduler tcp://10.0.0.1:8786
  isochrony batch cruises/ -o results --resume --dry-run

exit status: 0 every input gave a value; 1 some did; 3 none did; 2 usage; 130 interrupted"""

_TLS = {"tls_ca": "tls_ca_file", "tls_cert": "tls_client_cert", "tls_key": "tls_client_key"}


def add_options(parser: argparse.ArgumentParser) -> None:
    """List the options."""
    add = parser.add_argument
    add("inputs", metavar="INPUT", nargs="+", help="record, scene, folder, or pattern in quotes")
    add("-o", dest="out", metavar="FOLDER", required=True, help="folder of results, summary and ledger")
    add_reduction_options(parser)
    add("--force", action="store_true", help="do everything anew, whatever is there")
    add("--json", action="store_true", help="JSON Lines of all results, in order, at the end")
    add = parser.add_argument_group("scenes").add_argument
    add("--sweep", action="append", metavar="KEY=VALUES", help="values A,B,C or LOW:HIGH:COUNT of a key")
    add("--repeat", type=positive("--repeat"), metavar="N", help="members a point, each with its own seed")
    add("--allow-paths", action="store_true", help="a scene's tables may lie outside its folder")
    add = parser.add_argument_group("course").add_argument
    add("--resume", action="store_true", help="keep what was done and still holds")
    add("--retry-failed", action="store_true", help="--resume, and do again what failed")
    add("--dry-run", action="store_true", help="tell what would be done, and leave")
    add("--limit", type=positive("--limit"), metavar="N", help="do at most N inputs, keep the others for later")
    add = parser.add_argument_group("work").add_argument
    add("--jobs", type=positive("--jobs"), metavar="N", help="processes (default: one a processor)")
    add("--timeout", type=number("--timeout", above=0.0), default=600.0, metavar="S", help="s an input (600)")
    add("--memory", type=positive("--memory"), default=512, metavar="MIB", help="MiB a process (512)")
    add("--trusted", action="store_true", help="do not limit memory")
    add("--executor", choices=("pool", "serial"), default="pool", help="pool (default) or serial")
    add("--scheduler", metavar="ADDRESS", help="of a dask cluster, such as tls://10.0.0.1:8786")
    add("--tls-ca", metavar="FILE", help="certificate that the cluster's are signed with")
    add("--tls-cert", metavar="FILE", help="own certificate, for the cluster")
    add("--tls-key", metavar="FILE", help="own key, for the cluster")


def run(options: argparse.Namespace) -> int:
    """Do the batch, and tell what became of it."""
    _check(options)
    from pipeline.batch.campaign import Tally
    from pipeline.batch.ledger import Ledger, Log
    from pipeline.cli.batch_jobs import jobs_of, tell_end, tell_plan
    from pipeline.cli.outputs import folder_for_output
    from pipeline.provenance import versions

    folder = Path(options.out)
    jobs = jobs_of(options, folder)
    _refuse(options, folder, jobs)
    if options.dry_run:
        return tell_plan(jobs, folder, versions(), options)
    tally = Tally(len(jobs))
    with folder_for_output(folder), Ledger(folder, versions()) as ledger, Log(folder) as log:
        log.event("begin", command=sys.argv, inputs=len(jobs), versions=versions())
        try:
            summary = _do(options, jobs, ledger, log, tally)
        except (KeyboardInterrupt, SystemExit) as leaving:
            log.event("interrupted", done=tally.done, kept=tally.kept)
            told = f"{tally.done + tally.kept} of {tally.total} inputs are done; the same with --resume goes on"
            complain(f"interrupted: {told}")
            return leaving.code if isinstance(leaving, SystemExit) and isinstance(leaving.code, int) else 130
        status = tell_end(jobs, ledger, folder, tally, log, as_json=options.json)
        return status if summary else max(status, 1)


def _do(options: argparse.Namespace, jobs: Any, ledger: Any, log: Any, tally: Any) -> bool:
    """Do the work; whether the summary could be written."""
    from pipeline.batch import campaign
    from pipeline.batch.campaign import remove_leftovers
    from pipeline.batch.summary import write_summary
    from pipeline.cli.outputs import orderly

    folder = Path(options.out)
    with orderly(), progress("batch", " records") as draw:
        remove_leftovers(folder)
        how = {"anew": options.force, "retry_failed": options.retry_failed, "limit": options.limit, "progress": draw}
        try:
            campaign.run(jobs, ledger, _executor(options, jobs), log, tally, **how)
        finally:
            remove_leftovers(folder)  # of processes that were ended
        try:
            write_summary(jobs, ledger, folder)
        except FileError as fault:  # the results are there all the same
            complain(f"{fault}; then --resume writes it")
            return False
    return True


def _executor(options: argparse.Namespace, jobs: Any) -> Any:
    """The executor asked for, as a function of jobs alone."""
    limits = {"methods": jobs[0][1].method, "timeout": options.timeout}
    if options.scheduler is not None:
        from pipeline.batch.cluster import clustered

        security = {_TLS[name]: value for name in _TLS if (value := getattr(options, name)) is not None}
        return partial(clustered, address=options.scheduler, security=security, told=complain, **limits)
    from pipeline.batch.executors import pooled, serial

    if options.executor == "serial":
        return serial
    return partial(pooled, workers=min(options.jobs or processors(), len(jobs)), **limits)


def _check(options: argparse.Namespace) -> None:
    if not options.out:
        raise UsageError("batch: -o wants a folder, not an empty name")
    if options.executor == "serial" and not options.trusted:
        raise UsageError("batch: --executor serial reads inputs in this process, unguarded; add --trusted if they are")
    if options.executor == "serial" and (options.scheduler is not None or options.jobs is not None):
        raise UsageError("batch: --executor serial has one process; leave --jobs and --scheduler out")
    if options.scheduler is not None and options.jobs is not None:
        raise UsageError("batch: --jobs is about this machine; with --scheduler the cluster's workers count")
    given = [getattr(options, name) for name in _TLS]
    if any(given) and not (all(given) and (options.scheduler or "").startswith("tls://")):
        raise UsageError("batch: --tls-ca, --tls-cert and --tls-key go together, with --scheduler tls://HOST:PORT")
    for path in filter(None, given):
        if not os.path.isfile(path):
            raise UsageError(f"{path}: is not a file; give the certificate or key in PEM")
    if options.force and (options.resume or options.retry_failed):
        raise UsageError("batch: --force does everything anew, --resume keeps what was done; give one of them")


def _refuse(options: argparse.Namespace, folder: Path, jobs: Any) -> None:
    """Raise `UsageError` where something of the user's, or of a batch begun before, would be overwritten."""
    from pipeline.batch.ledger import NAME
    from pipeline.batch.summary import NAMES
    from pipeline.cli.outputs import refuse_clashes

    resumes = options.resume or options.retry_failed
    begun = os.path.lexists(folder / NAME)
    if begun and not (resumes or options.force or options.dry_run):
        raise UsageError(f"{folder}: a batch was begun there; go on with --resume, or do it anew with --force")
    inputs = list(dict.fromkeys(path for path, _ in jobs))
    outputs = [config.output for _, config in jobs] + [folder / name for name in NAMES]
    refuse_clashes(inputs, outputs, force=begun or options.force)
