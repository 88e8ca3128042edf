"""`isochrony batch`: thousands of records, unattended."""

from __future__ import annotations

import argparse
import os

from data_schemas.errors import UsageError

_TLS = {"tls_ca": "tls_ca_file", "tls_cert": "tls_client_cert", "tls_key": "tls_client_key"}  # as dask names them


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
