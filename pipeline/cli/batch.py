"""`isochrony batch`: thousands of records, unattended."""

from __future__ import annotations

import argparse
import os

from data_schemas.errors import UsageError
from pipeline.cli.parser import number, positive
from pipeline.cli.process import add_reduction_options

_TLS = {"tls_ca": "tls_ca_file", "tls_cert": "tls_client_cert", "tls_key": "tls_client_key"}  # as dask names them


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
    """Do the batch, and tell what became of it; options that contradict each other are refused before any work."""
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

    options.security = {of_dask: path for of_dask, path in zip(_TLS.values(), given, strict=True) if path is not None}
    from pipeline.cli.batch_jobs import run_batch  # what works is imported only here

    return run_batch(options)
