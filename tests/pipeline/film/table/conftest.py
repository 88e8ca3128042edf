"""Its presence puts this folder on the path, so that tests here import `stand_in_session`; the served stand-in."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from queue import Queue

import pytest
from stand_in_session import Served, StandInSession

from pipeline.film.table.server import serve


@pytest.fixture
def served() -> Iterator[Served]:
    """One of its own for each test."""
    yield from _served()


@pytest.fixture(scope="module")
def standing() -> Iterator[Served]:
    """One for all tests that change nothing."""
    yield from _served()


def _served() -> Iterator[Served]:
    session, urls = StandInSession(), Queue[str]()
    thread = threading.Thread(target=serve, args=[session], kwargs={"browser": False, "ready": urls.put})
    thread.start()
    here = Served(session, urls.get(timeout=10), thread)
    yield here
    session.gate.set()
    here.end()
    assert not thread.is_alive()
