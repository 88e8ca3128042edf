"""The same by dask: what the pool gives, crashes and hangs included; schedulers that are not there are told."""

from __future__ import annotations

import functools
import multiprocessing
import os
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from batch_parts import METHODS, alike, config_of, numbers_of

from data_schemas.errors import UsageError
from pipeline.batch import cluster
from pipeline.batch.cluster import clustered
from pipeline.batch.executors import serial

distributed = pytest.importorskip("distributed")  # before any test could have changed what is imported

ROOT = Path(__file__).parents[2]


# dask's own, and those of sockets it closes when it likes
pytestmark = pytest.mark.filterwarnings("ignore")


def jobs_of(small, tmp_path, out, words):
    jobs = []
    for number, word in enumerate(words):
        path = tmp_path / f"{word}-{number}.record.nc"
        shutil.copy(small, path)
        jobs.append((path, config_of(out, f"{number}")))
    return jobs


def check(address, small, tmp_path, out, words):
    """Good records come out as serially, the bad ones cost themselves alone."""
    jobs = jobs_of(small, tmp_path, out, words)
    coming = clustered(jobs, address=address, methods=METHODS, timeout=20.0)
    outcomes = {one.key: one for batch in coming for one in batch}
    classes = {"good": None, "crash": "Crashed", "hang": "TimedOut"}
    assert [outcomes[config.key].error_class for _, config in jobs] == [classes[word] for word in words]
    path, config = jobs[0]
    alone = config_of(out / "serial", config.key)
    ((one,),) = serial([(path, alone)])
    assert alike(one.rows, outcomes[config.key].rows)
    assert alike(numbers_of(alone.output), numbers_of(config.output))


def lost(*_):
    raise TypeError("no such thing here")


def _end_children():
    """Of the cluster's threads: they would end with this process only."""
    for child in multiprocessing.active_children():
        child.terminate()
        child.join()


@pytest.mark.compiled
def test_a_local_cluster(small, tmp_path, out, monkeypatch, request):
    """In threads: what is in these processes is seen by coverage; faults of the cluster's own are outcomes too."""
    request.addfinalizer(_end_children)
    LocalCluster = distributed.LocalCluster
    settings = {"n_workers": 1, "threads_per_worker": 2, "processes": False, "dashboard_address": None}
    with LocalCluster(**settings, local_directory=str(tmp_path / "dask")) as local:
        check(local.scheduler_address, small, tmp_path, out, ["good", "crash", "good", "good", "good"])
        odd = config_of(out, "odd")
        monkeypatch.setattr("pipeline.batch.cluster._process_isolated", lost)
        coming = clustered([(small, odd)], address=local.scheduler_address, methods=METHODS, timeout=20.0)
        ((one,),) = coming
        assert one.error_class == "WorkerLost"
        assert "odd.result.nc: the cluster gave it up: TypeError" in one.error
        assert list(clustered([], address=local.scheduler_address, methods=METHODS, timeout=1.0)) == []


@pytest.mark.compiled
def test_scheduler_and_workers_of_their_own_on_the_loopback(small, tmp_path, out, monkeypatch):
    """As on a cluster: separate processes that know nothing of each other but an address."""
    env = os.environ | {"PYTHONPATH": f"{ROOT}:{Path(__file__).parent}"}
    start = functools.partial(subprocess.Popen, env=env, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    here = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    with start([sys.executable, "-m", "distributed.cli.dask_scheduler", *here]) as scheduler:
        processes = [scheduler]
        try:
            told = next(line for line in scheduler.stderr if "Scheduler at" in line)
            address = re.search(r"tcp://127\.0\.0\.1:\d+", told)[0]
            monkeypatch.setattr(cluster, "PATIENCE", 0.5)
            with pytest.raises(UsageError, match=r"has no workers for 0 s; start some with .* and go on with --resume"):
                next(clustered([(small, config_of(out, "a"))], address=address, methods=METHODS, timeout=5.0))
            one_each = ["--nworkers", "2", "--nthreads", "1", "--no-dashboard", "--local-directory", str(tmp_path)]
            processes.append(start([sys.executable, "-m", "distributed.cli.dask_worker", address, *one_each]))
            next(line for line in processes[1].stderr if "Starting established connection" in line)
            check(address, small, tmp_path, out, ["good", "hang", "good"])
            jobs = jobs_of(small, tmp_path, out, ["good", "hang"])
            coming = clustered(jobs, address=address, methods=METHODS, timeout=60.0)
            next(coming)
            scheduler.kill()
            with pytest.raises(UsageError, match="the scheduler is gone; start one, and go on with --resume"):
                list(coming)
        finally:
            for process in reversed(processes):
                process.terminate()
                process.communicate()


def test_a_thread_keeps_its_process_until_other_settings_come(small, out, monkeypatch):
    made = []

    class Child:
        def __init__(self, *form):
            self.form, self.course = form, []
            made.append(self)

        def run(self, path, config):
            self.course.append(config.key)

        def stop(self):
            self.course.append("stopped")

    monkeypatch.setattr(cluster, "Isolated", Child)
    monkeypatch.setattr(cluster, "_OWN", threading.local())
    for name, timeout in (("a", 5.0), ("b", 5.0), ("c", 6.0)):
        cluster._process_isolated(small, config_of(out, name), METHODS, timeout)
    assert [child.course for child in made] == [["a.result.nc", "b.result.nc", "stopped"], ["c.result.nc"]]


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://x"])
def test_a_scheduler_that_does_not_answer_is_told(small, out, address):
    with pytest.raises(UsageError, match=f"--scheduler {address}: no scheduler answers"):
        next(clustered([(small, config_of(out, "a"))], address=address, methods=METHODS, timeout=5.0))


def test_without_dask_the_remedy_is_told(small, out, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UsageError, match=r"install 'isochrony\[cluster\]'"):
        next(clustered([(small, config_of(out, "a"))], address="tcp://x:1", methods=METHODS, timeout=5.0))


class Cluster:
    """What is asked of dask's client: how many threads there are, now and after waiting for a worker."""

    def __init__(self, now, fault=None):
        self.now, self.fault = now, fault

    def nthreads(self):
        if self.now is None:
            raise self.fault
        return dict(enumerate(self.now))

    def wait_for_workers(self, count, timeout):
        assert (count, timeout) == (1, 300.0)
        if self.fault:
            raise self.fault
        self.now = [2]


def test_a_cluster_that_loses_its_workers_is_told_of_and_waited_for():
    """It waited in silence."""
    told = []
    assert cluster._threads(Cluster([2, 1]), "tcp://a:1", told.append) == 3
    assert told == []
    assert cluster._threads(Cluster([]), "tcp://a:1", told.append) == 2
    assert told == [
        "--scheduler tcp://a:1: has no workers; waiting 300 s for them, start some with 'dask worker tcp://a:1'"
    ]


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (TimeoutError(), "has no workers for 300 s; start some with 'dask worker tcp://a:1', and go on with --resume"),
        (OSError(), "the scheduler is gone; start one, and go on with --resume"),
    ],
)
def test_a_cluster_without_workers_is_left(fault, words):
    for now in ([], None):  # while it is waited for, or asked
        with pytest.raises(UsageError, match=f"^--scheduler tcp://a:1: {words}$"):
            cluster._threads(Cluster(now, fault), "tcp://a:1", lambda _: None)


@pytest.mark.compiled
def test_a_cluster_by_tls(small, tmp_path, out, request):
    request.addfinalizer(_end_children)
    trustme = pytest.importorskip("trustme")
    authority = trustme.CA()
    own = authority.issue_cert("localhost")
    authority.cert_pem.write_to_path(tmp_path / "ca.pem")
    own.private_key_and_cert_chain_pem.write_to_path(tmp_path / "own.pem")
    files = {"tls_ca_file": str(tmp_path / "ca.pem")}
    files |= {
        f"tls_{who}_{part}": str(tmp_path / "own.pem")
        for who in ("scheduler", "worker", "client")
        for part in ("cert", "key")
    }
    settings = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    secured = distributed.Security(**files, require_encryption=True)
    given = {name: files[name] for name in ("tls_ca_file", "tls_client_cert", "tls_client_key")}
    with distributed.LocalCluster(
        **settings, protocol="tls://", security=secured, local_directory=str(tmp_path / "dask")
    ) as local:
        address = local.scheduler_address
        assert address.startswith("tls://")
        ((one,),) = clustered(
            [(small, config_of(out, "a"))], address=address, methods=METHODS, timeout=60.0, security=given
        )
        assert one.status == "ok"
        with pytest.raises(UsageError, match="no scheduler answers"):
            next(clustered([(small, config_of(out, "b"))], address=address, methods=METHODS, timeout=5.0))
