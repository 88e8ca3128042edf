"""The package's front: everything named is there, nothing heavy comes along."""

from __future__ import annotations

import subprocess
import sys

import pytest

import data_schemas


def test_everything_named_is_there():
    for name in data_schemas.__all__:
        assert getattr(data_schemas, name) is not None
    assert dir(data_schemas) == sorted(data_schemas.__all__)
    with pytest.raises(AttributeError, match="no attribute 'load_film'"):
        data_schemas.load_film  # noqa: B018  # the access is the test


@pytest.mark.parametrize(
    ("statement", "absent"),
    [
        ("import data_schemas", {"numpy", "xarray", "h5py", "pydantic"}),
        ("from data_schemas import check, read, validate, write", {"scipy", "numba", "pydantic", "matplotlib"}),
    ],
)
def test_nothing_heavy_comes_along(statement, absent):
    program = f"import sys; {statement}; print(*(name.partition('.')[0] for name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert absent.isdisjoint(done.stdout.split())


def test_a_scene_is_validated_by_its_suffix(tmp_path):
    path = tmp_path / "scene.toml"
    faults = data_schemas.validate(path)
    assert len(faults) == 1
    assert str(path) in faults[0]
    path.write_text("[gravty]\nvalue = 9.8\n")
    assert any("gravty" in fault for fault in data_schemas.validate(path))
