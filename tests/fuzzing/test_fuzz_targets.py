"""What fuzzing has found, and some thousand changed files beside it: short, and without a fuzzer."""

from __future__ import annotations

import contextlib
import os
import signal
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

pytest.importorskip("tifffile")
pytest.importorskip("PIL")

from fuzz_targets import BYTES, SECONDS, TARGETS, mutated
from sealing import sealed

import data_schemas
from data_schemas.errors import FileError, IsochronyError
from data_schemas.shield import bounded

CORPUS = Path(__file__).parent / "corpus"
COUNTS = {"hdf5": 200, "film": 800, "csv": 800, "toml": 400}


class Hang(BaseException):
    """Passes whatever the readers catch."""


def held():
    """Bytes of memory that tests before have left to this process."""
    sizes = Path("/proc/self/statm")
    return int(sizes.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") if sizes.exists() else 0


@contextlib.contextmanager
def limited():
    """The time and the memory of one input."""

    def stop(*_):
        raise Hang

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        with bounded(BYTES + held()):
            yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("found", sorted(CORPUS.glob("*/*")), ids=lambda found: found.name)
def test_inputs_that_were_findings(tmp_path, found):
    with limited():
        TARGETS[found.parent.name](tmp_path, found.read_bytes())


def text_time(file):
    del file["time"]
    file["time"] = ["a"] * 12


def text_motion(file):
    file["heave"] = ["a"] * 12


def infinite_times(file):
    file["time"][:] = np.inf


def overflow(file):
    file["record/elongation"].attrs["scale_factor"] = 1e308
    file["record/elongation"][:] = 1e300


def short_chunk(file):
    """HDF5 reads on beyond it, and ends the process or gives what is left there in memory."""
    array = file["record"].create_dataset("other", (10**7,), "f8", chunks=(10**7,), compression=1)
    array.id.write_direct_chunk((0,), zlib.compress(b"short"))


def bomb_in_chunk(file):
    array = file["record"].create_dataset("other", (10,), "f8", chunks=(10,), compression=1)
    array.id.write_direct_chunk((0,), zlib.compress(bytes(1 << 28), 1))


def square(file):
    file["record/other"] = np.ones((12, 12))


def square_of_one_scale(file):
    file["record/other"] = np.ones((12, 12))
    for dimension in file["record/other"].dims:
        dimension.attach_scale(file["time"])


EDITS = (text_time, text_motion, infinite_times, overflow, square, square_of_one_scale, short_chunk, bomb_in_chunk)


@pytest.mark.parametrize("edit", EDITS, ids=lambda edit: edit.__name__)
def test_records_that_were_findings(tmp_path, edit):
    path = tmp_path / "edited.nc"
    path.write_bytes(next(TARGETS["hdf5"].seeds(tmp_path)))
    with h5py.File(path, "a") as file:
        edit(file)
    with limited():
        TARGETS["hdf5"](tmp_path, path.read_bytes())


@pytest.mark.parametrize("edit", [short_chunk, bomb_in_chunk])
def test_chunks_of_a_wrong_size_are_refused(tmp_path, edit):
    path = tmp_path / "edited.nc"
    path.write_bytes(next(TARGETS["hdf5"].seeds(tmp_path)))
    with h5py.File(path, "a") as file:
        edit(file)
    with limited(), pytest.raises(FileError, match=r"record/other: its values are damaged \(a chunk of"):
        data_schemas.read(path)


def test_record_of_too_many_traces_is_refused(tmp_path):
    """Whether its pendulums can be told apart takes the cube of their number."""
    path = tmp_path / "edited.nc"
    path.write_bytes(next(TARGETS["hdf5"].seeds(tmp_path)))
    with h5py.File(path, "a") as file:
        del file["record/combination"]
        file["record/combination"] = np.ones((501, 501))
    assert any("more than 500 traces or pendulums" in fault for fault in data_schemas.validate(path))


def test_chunks_of_noise_are_read(tmp_path):
    noise = np.random.default_rng(1).bytes(80_000)
    path = tmp_path / "noise.nc"
    with h5py.File(path, "w") as file:
        for kind in ("u1", "f8", "S8"):
            values = np.frombuffer(noise, kind) if kind != "S8" else np.array([b"a", b"bc"] * 40)
            chunks = (values.size // 3,)
            file.create_dataset(kind, data=values, chunks=chunks, shuffle=True, compression=9, fletcher32=True)
    variables = data_schemas.read(path)
    np.testing.assert_array_equal(variables["u1"].values, np.frombuffer(noise, "u1"))


def patched(seed, name, place, new):
    """A seed with bytes changed, counted from the first attribute of a name."""
    bad = bytearray(seed)
    at = bad.index(name) + place
    bad[at : at + len(new)] = new
    return sealed(bytes(bad))


@pytest.mark.parametrize("change", [(16, b"\x0b"), (16, b"\xff\xff\xff\x0f")])
def test_lists_of_no_known_kind_are_not_read(tmp_path, change):
    seed = next(TARGETS["hdf5"].seeds(tmp_path))
    TARGETS["hdf5"](tmp_path, patched(seed, b"DIMENSION_LIST\0", *change))


def test_empty_chunk_with_a_checksum_is_refused(tmp_path):
    seed = next(TARGETS["hdf5"].seeds(tmp_path))
    single = b"\x04\x02\x02\x02\x01\x02\x08\x01"  # layout of one filtered chunk; then its size
    with limited():
        TARGETS["hdf5"](tmp_path, patched(seed, single, len(single), bytes(8)))


TABLES = {
    "long run of blanks": "time,a" + " " * 60_000 + "b\n0,1\n1,2\n",
    "label of digits": "time," + "1" * 5000 + "\n0,1\n1,2\n",
    "field over many lines": 't,"x' + ("a" * 60_000 + "\n") * 3,
}


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_tables_that_were_findings(tmp_path, table):
    with limited():
        TARGETS["csv"](tmp_path, table.encode())


@pytest.mark.parametrize("name", TARGETS)
def test_changed_files_give_errors_of_ours(tmp_path, name):
    target = TARGETS[name]
    seeds = list(target.seeds(tmp_path))
    draw = np.random.default_rng(1)
    for number in range(COUNTS[name]):
        bad = target.seal(mutated(seeds[number % len(seeds)], draw))
        with limited():
            try:
                target(tmp_path, bad)
            except Exception as fault:
                (tmp_path / "finding").write_bytes(bad)
                raise AssertionError(f"input {number}, kept as {tmp_path / 'finding'}") from fault


@pytest.mark.parametrize("name", TARGETS)
def test_good_files_pass_and_keep_their_checksums(tmp_path, name):
    target = TARGETS[name]
    for seed in target.seeds(tmp_path):
        assert target.seal(seed) == seed
        path = tmp_path / f"good{target.ending}"
        path.write_bytes(seed)
        assert any(_reads(reader, path) for reader in target.readers)


def _reads(reader, path):
    try:
        reader(path)
    except IsochronyError:
        return False
    return True


def test_changed_headers_are_sealed(tmp_path):
    changed = 0
    for seed in TARGETS["hdf5"].seeds(tmp_path):
        at = seed.find(b"combination")
        header = seed.rfind(b"OHDR", 0, max(at, 0))
        if header < 0:
            continue  # of the oldest format, which has no checksums
        path = tmp_path / "changed.nc"
        path.write_bytes(sealed(seed.replace(b"combination", b"combinatiom")))
        with h5py.File(path) as file:
            changed += "combinatiom" in file["record"]
    assert changed
