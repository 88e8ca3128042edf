"""A folder with records, and one to put results in."""

from __future__ import annotations

from pathlib import Path

import pytest
from batch_parts import write_record


@pytest.fixture(scope="session")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record that is processed in a blink; not to be changed."""
    return write_record(tmp_path_factory.mktemp("small") / "small.record.nc")


@pytest.fixture
def out(tmp_path: Path) -> Path:
    folder = tmp_path / "out"
    folder.mkdir()
    return folder
