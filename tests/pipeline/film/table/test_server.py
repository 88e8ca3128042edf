"""The server of the table: whom it answers, what it refuses, and how it ends."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import subprocess
import sys
import threading
import time
import webbrowser
from pathlib import Path
from queue import Queue
from typing import Any

import pytest
from stand_in_session import ROWS, Served, StandInSession

from data_schemas.errors import UsageError
from pipeline.cli.main import main
from pipeline.film.table.server import serve

BREAK = {"kind": "break", "row": 100.0}


def state(served: Served) -> dict[str, Any]:
    return json.loads(served.ask("/state")[1])


def error(answer: tuple[int, bytes, Any]) -> str:
    return json.loads(answer[1])["error"]


def until(condition: Any) -> None:
    end = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


# ---- whom it answers


@pytest.mark.parametrize("path", ["/", "/page.js", "/state", "/tile/0/0/0", "/readings.csv", "/nowhere"])
@pytest.mark.parametrize("token", [None, "", "wrong", "\u00e9"])
def test_without_the_token_nothing_is_answered(standing: Served, path: str, token: str | None) -> None:
    assert standing.ask(path, X_Token=token)[0] == 403


def test_token_may_stand_in_the_address_of_what_is_looked_at_alone(standing: Served) -> None:
    assert standing.ask(f"/?token={standing.token}", X_Token=None)[0] == 200
    assert standing.ask(f"/tile/0/0/0?token={standing.token}", X_Token=None)[0] == 200
    assert standing.ask(f"/undo?token={standing.token}", {}, X_Token=None)[0] == 403


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.1:1", "localhost:8765", "[::1]:99", "LOCALHOST"])
def test_hosts_of_a_tunnel_are_answered(standing: Served, host: str) -> None:
    assert standing.ask("/state", Host=host)[0] == 200
    assert standing.ask("/state", Origin=f"http://{host}")[0] == 200


@pytest.mark.parametrize(
    "host", ["", "example.org", "127.0.0.1.example.org", "localhost:x", "127.0.0.2", "a@localhost"]
)
def test_other_hosts_and_pages_are_refused(standing: Served, host: str) -> None:
    assert standing.ask("/state", Host=host)[0] == 400
    assert standing.ask("/state", Origin=f"http://{host}")[0] == 403
    assert standing.ask("/undo", {}, Origin=host or "null")[0] == 403


def test_it_listens_on_this_machine_alone(standing: Served) -> None:
    assert standing.url.startswith(f"http://127.0.0.1:{standing.port}/?token=")
    assert len(standing.token) >= 40


@pytest.mark.parametrize("path", ["/", "/state", "/nowhere", "/tile/9/0/0"])
def test_every_answer_bears_the_headers_of_safety(standing: Served, path: str) -> None:
    headers = standing.ask(path)[2].headers
    assert headers["Content-Security-Policy"].startswith("default-src 'self';")
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["Cache-Control"] == "no-store"


def test_page_has_no_script_of_its_own(standing: Served) -> None:
    page = standing.ask("/")[1].decode()
    assert "TOKEN" not in page
    assert page.count("<script") == page.count('<script type="module" src=') == 1
    assert "style=" not in page
    assert "onclick" not in page


# ---- what is posted


def test_other_kinds_of_content_are_refused(standing: Served) -> None:
    assert standing.ask("/undo", b"{}", Content_Type="text/plain")[0] == 415
    assert standing.ask("/undo", b"{}", Content_Type="application/x-www-form-urlencoded")[0] == 415


@pytest.mark.parametrize("body", [b"", b"[]", b"{", b"\xff", b"[" * 500_000])
def test_what_is_no_object_is_refused(standing: Served, body: bytes) -> None:
    assert standing.ask("/undo", body)[0] == 400


@pytest.mark.parametrize("size", ["1048577", "99999999999999"])
def test_size_is_bounded(standing: Served, size: str) -> None:
    assert standing.ask("/edits", b"{}", Content_Length=size)[0] == 413


def test_size_is_bounded_where_it_is_not_said(standing: Served) -> None:
    pieces = 16 * (b"10000\r\n" + b" " * 0x10000 + b"\r\n") + b"1\r\n \r\n"  # a byte more than 1 MB, and no end
    assert standing.ask("/edits", pieces, Transfer_Encoding="chunked")[0] == 413


@pytest.mark.parametrize("edits", [None, {}, [], [1], [BREAK] * 10])
def test_edits_are_one_or_a_few(standing: Served, edits: Any) -> None:
    assert "one edit or a few" in error(standing.ask("/edits", {"edits": edits}))


def test_faulty_edit_is_one_line(standing: Served) -> None:
    answer = standing.ask("/edits", {"edits": [{"kind": "mark", "row": 1.0, "time": "25:99"}]})
    assert answer[0] == 422
    assert "'25:99' is no time" in error(answer)
    assert "\n" not in error(answer)
    assert state(standing)["revision"] == 0


def test_edit_is_kept_with_its_author(served: Served) -> None:
    assert served.ask("/who", {"who": " Ada "})[0] == 200
    status, body, _ = served.ask("/edits", {"edits": [BREAK]})
    assert status == 200
    assert json.loads(body)["edits"][0]["by"] == "Ada"
    assert state(served)["who"] == "Ada"
    assert served.ask("/who", {"who": "x" * 101})[0] == 400


def test_two_edits_are_one_step(served: Served) -> None:
    pair = [{"kind": "no-mark", "row": 60.0}, {"kind": "mark", "row": 66.0}]
    for edits in ([BREAK], pair):
        assert served.ask("/edits", {"edits": edits})[0] == 200
    counts = [len(json.loads(served.ask(path, {})[1])["edits"]) for path in ("/undo", "/undo", "/redo", "/redo")]
    assert counts == [1, 0, 1, 3]
    assert served.ask("/edits", {"edits": [pair[0], {"kind": "mark"}]})[0] == 422
    assert len(state(served)["edits"]) == 3
    assert served.ask("/undo", {})[0] == 200
    assert [served.ask("/edits", {"edits": [BREAK]})[0] for _ in range(2)] == [200, 200]
    assert len(json.loads(served.ask("/undo", {})[1])["edits"]) == 2  # the pair there was once is forgotten


def test_nothing_to_undo_is_a_line(standing: Served) -> None:
    assert "nothing to undo" in error(standing.ask("/undo", {}))


# ---- while an edit is under way


def test_film_is_shown_while_it_is_read_anew(served: Served) -> None:
    served.session.gate.clear()
    answers = Queue[int]()
    edit = threading.Thread(target=lambda: answers.put(served.ask("/edits", {"edits": [BREAK]})[0]))
    edit.start()
    until(lambda: state(served)["busy"])
    assert state(served)["revision"] == 0
    assert served.ask("/tile/0/0/0")[0] == served.ask("/overlay?first=0&last=9&most=9")[0] == 200
    assert [served.ask(path, {"edits": [BREAK]})[0] for path in ("/edits", "/undo", "/done")] == [409] * 3
    served.session.gate.set()
    assert answers.get(timeout=10) == 200
    edit.join()
    assert (state(served)["busy"], state(served)["revision"]) == (False, 1)


# ---- what is looked at


def test_tiles_are_kept_by_the_browser(standing: Served) -> None:
    status, body, response = standing.ask("/tile/1/2/0")
    assert (status, body[:4]) == (200, b"\x89PNG")
    assert "max-age" in response.headers["Cache-Control"]


@pytest.mark.parametrize("tile", ["6/0/0", "0/12/0", "0/0/2", "5/1/0", "99/0/0", "-1/0/0"])
def test_tiles_beyond_the_film_are_none(standing: Served, tile: str) -> None:
    assert standing.ask(f"/tile/{tile}")[0] == 404


@pytest.mark.parametrize("query", ["", "first=0&last=9", "first=a&last=9&most=9", "first=9&last=9&most=9",
                                   f"first=0&last={ROWS + 1}&most=9", "first=0&last=9&most=0"])  # fmt: skip
def test_overlay_wants_rows_of_the_film(standing: Served, query: str) -> None:
    status, body, _ = standing.ask(f"/overlay?{query}")
    assert status == 400
    assert "overlay wants" in json.loads(body)["error"]


def test_flags_are_told_with_their_remedy(standing: Served) -> None:
    assert "scan with more contrast" in state(standing)["flag_words"]["marks-many-missing"]


def test_readings_are_a_table(standing: Served) -> None:
    status, body, response = standing.ask("/readings.csv")
    assert (status, body) == (200, b"time,1,1-2\n0.0,0.01,0.02\n")
    assert response.headers["Content-Type"].startswith("text/csv")


# ---- begin and end


def test_port_in_use_is_refused(standing: Served) -> None:
    with pytest.raises(UsageError, match=f"port {standing.port} cannot be had"):
        serve(StandInSession(), port=standing.port, browser=False)
    with pytest.raises(UsageError, match="port 70000 is none"):
        serve(StandInSession(), port=70_000, browser=False)


def test_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert main(["digitise", "a.tif", "--table"]) == 2
    assert "isochrony[table]" in capsys.readouterr().err


@pytest.mark.parametrize("display", [":0", ""])
def test_browser_is_opened_where_there_is_a_display(display: str, monkeypatch: pytest.MonkeyPatch) -> None:
    opened, urls = Queue[str](), Queue[str]()
    monkeypatch.setattr(webbrowser, "open", opened.put)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    session = StandInSession()
    thread = threading.Thread(target=serve, args=[session], kwargs={"ready": urls.put})
    thread.start()
    served = Served(session, urls.get(timeout=10), thread)
    served.end()
    assert not thread.is_alive()
    assert opened.get(timeout=10) == served.url if display else opened.empty()


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent in another way")
def test_interrupt_ends_it_cleanly() -> None:
    program = (
        "from stand_in_session import StandInSession\n"
        "from pipeline.film.table.server import serve\n"
        "serve(StandInSession())"
    )
    paths = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    environment = {**os.environ, "PYTHONPATH": paths, "DISPLAY": "", "WAYLAND_DISPLAY": ""}
    with subprocess.Popen(
        [sys.executable, "-c", program], stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stderr is not None
        assert process.stderr.readline().startswith("http://127.0.0.1:")
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
        assert process.stderr.read() == ""
