"""The server of the table: to whom it answers (`guarded`), what (`Desk`), and until when (`serve`)."""

import contextlib
import hmac
import json
import os
import re
import secrets
import socket
import sys
import threading
import webbrowser
from collections.abc import AsyncIterator, Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware.base import BaseHTTPMiddleware, RequestResponseEndpoint
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from data_schemas.errors import IsochronyError, UsageError
from pipeline.flag_words import FLAGS, told

if TYPE_CHECKING:
    from pipeline.film.table.session import Session

_MOST_BYTES = 2**20  # of what is posted: an edit has some hundreds
_MOST_ROWS = 10_000  # of an overlay
_TILE = 512  # px
PATIENCE = 10  # s that requests under way are given when the server ends
_HERE = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:\d{1,5})?", re.IGNORECASE)  # any port: tunnels map them
_KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Desk:
    """Brings requests, each in a thread of its own, to the session: one change at a time, and one look beside it."""

    def __init__(self, session: "Session") -> None:
        self.session = session
        self.end: Callable[[], object] = lambda: None
        self._editing, self._using, self._looking = threading.Lock(), threading.Lock(), threading.Lock()
        self._state = session.state()

    def routes(self) -> list[Route]:
        """Every address with what answers it."""
        posted: dict[str, Callable[..., Any]] = {"edits": self._edits, "who": self._who, "done": self._done}
        posted |= {name: partial(self._step, getattr(self.session, name)) for name in ("undo", "redo")}
        return [
            Route("/state", self._now),
            Route("/overlay", self._overlay),
            Route("/times", self._times),
            Route("/tile/{level:int}/{down:int}/{across:int}", self._tile),
            Route("/readings.csv", self._csv),
            *(Route(f"/{name}", answer, methods=["POST"]) for name, answer in posted.items()),
        ]

    def _now(self, _: Request) -> Response:
        """The state: of the last finished reading while an edit is under way, otherwise as gravity is by now."""
        if not self._editing.locked():
            with self._using:
                self._state = self.session.state()
        return self._told()

    def _told(self) -> Response:
        state, session = self._state, self.session
        words = {flag: told(flag) for flag in state["reading"]["flags"] if flag in FLAGS}
        busy = self._editing.locked()
        return JSONResponse(state | {"busy": busy, "who": session.who, "levels": session.levels, "flag_words": words})

    def _overlay(self, request: Request) -> Response:
        try:
            first, last, most = (int(request.query_params[name]) for name in ("first", "last", "most"))
        except (KeyError, ValueError):
            raise HTTPException(400, "overlay wants whole numbers first, last and most") from None
        rows = self._state["rows"]
        if not (0 <= first < last <= rows and 1 <= most <= _MOST_ROWS):
            raise HTTPException(400, f"overlay wants 0 <= first < last <= {rows} and 1 <= most <= {_MOST_ROWS}")
        with self._looking:
            return JSONResponse(self.session.overlay(first, last, most))

    def _times(self, _: Request) -> Response:
        """Rows of all marks on the first trace, with their labels."""
        with self._looking:
            shown = self.session.overlay(0, self._state["rows"], _MOST_ROWS)
        return JSONResponse([[mark["row"], mark["label"]] for mark in shown["marks"]])

    def _tile(self, request: Request) -> Response:
        level, down, across = (request.path_params[name] for name in ("level", "down", "across"))
        size = _TILE << min(level, 30)
        here = down * size < self._state["rows"] and across * size < self._state["columns"]
        if level >= self.session.levels or not here:
            raise HTTPException(404, "the film has no such tile")
        kept = {"Cache-Control": "private, max-age=86400"}
        with self._looking:
            return Response(self.session.tile(level, down, across), media_type="image/png", headers=kept)

    def _csv(self, _: Request) -> Response:
        with self._using:
            return Response(self.session.csv(), media_type="text/csv", headers={"Content-Disposition": "attachment"})

    def _edits(self, request: Request) -> Response:
        """Make one edit, or several as one step: all or none."""
        edits = request.state.content.get("edits")
        if not (isinstance(edits, list) and 1 <= len(edits) <= 9 and all(isinstance(each, dict) for each in edits)):
            raise HTTPException(400, "edits wants a list of one edit or a few")
        return self._step(partial(self.session.edit, *edits), request)

    def _step(self, change: Callable[[], dict[str, Any]], _: Request) -> Response:
        """The state after a change."""
        with self._alone(), self._using:
            self._state = change()
        return self._told()

    def _who(self, request: Request) -> Response:
        name = request.state.content.get("who")
        if not (isinstance(name, str) and len(name.strip()) <= 100):
            raise HTTPException(400, "who wants a name of at most 100 letters")
        with self._using:
            self.session.who = name.strip()
        return self._told()

    def _done(self, _: Request) -> Response:
        with self._alone():
            self.end()
        return JSONResponse({"saved": self._state["saved"]})

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        """Refuse what comes while an edit is under way."""
        if not self._editing.acquire(blocking=False):
            raise HTTPException(409, "the film is being read anew; wait until that is done")
        try:
            yield
        finally:
            self._editing.release()


async def _content(request: Request) -> dict[str, Any]:
    """What was posted: JSON, of bounded size."""
    if request.headers.get("content-type", "").split(";")[0].strip().lower() != "application/json":
        raise HTTPException(415, "post application/json")
    body, stated = bytearray(), int(request.headers.get("content-length", 0))  # the server takes whole numbers alone
    if stated <= _MOST_BYTES:
        async for piece in request.stream():
            body += piece
            if len(body) > _MOST_BYTES:
                break
    if max(stated, len(body)) > _MOST_BYTES:
        raise HTTPException(413, f"at most {_MOST_BYTES} bytes may be posted")
    try:
        content = json.loads(body)
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict):
        raise HTTPException(400, "post a JSON object")
    return content


def guarded(desk: Desk, token: str, begin: Callable[[], object]) -> ASGIApp:
    """Answer this machine's own pages that bring the token, refuse others; `begin` is called before the first."""

    def static(path: Path) -> Route:
        text, kind = path.read_text(encoding="utf-8").replace("TOKEN", token), _KINDS[path.suffix]
        return Route("/" if kind == "text/html" else f"/{path.name}", lambda _: Response(text, media_type=kind))

    def line(_: Request, fault: Exception) -> Response:
        if isinstance(fault, HTTPException):
            return JSONResponse({"error": fault.detail}, fault.status_code, fault.headers)
        return JSONResponse({"error": str(fault)}, 422)

    @contextlib.asynccontextmanager
    async def begun(_: Starlette) -> AsyncIterator[None]:
        begin()
        yield

    async def guard(request: Request, answer: RequestResponseEndpoint) -> Response:
        host, origin = request.headers.get("host", ""), request.headers.get("origin", "http://localhost")
        given = request.headers.get("x-token") or (request.method == "GET" and request.query_params.get("token")) or ""
        try:
            if not _HERE.fullmatch(host):
                raise HTTPException(400, "this server answers to 127.0.0.1 and localhost alone")
            if not (origin.startswith("http://") and _HERE.fullmatch(origin.removeprefix("http://"))):
                raise HTTPException(403, "requests of other pages are refused")
            if not hmac.compare_digest(given.encode(), token.encode()):
                raise HTTPException(403, "the token is missing or wrong: open the address that isochrony printed")
            if request.method == "POST":
                request.state.content = await _content(request)
            response = await answer(request)
        except HTTPException as fault:
            response = line(request, fault)
        response.headers.update(_HEADERS)
        response.headers.setdefault("Cache-Control", "no-store")
        return response

    page = [static(path) for path in Path(__file__).parent.iterdir() if path.suffix in _KINDS]
    faults = {HTTPException: line, IsochronyError: line}
    app = Starlette(routes=[*page, *desk.routes()], exception_handlers=faults, lifespan=begun)
    return BaseHTTPMiddleware(app, guard)


def serve(
    session: "Session", *, port: int = 0, browser: bool = True, ready: Callable[[str], object] | None = None
) -> None:
    """Serve a session on 127.0.0.1 until the person is done, or Ctrl-C. The address, with its token, goes to stderr.

    While an edit is under way `tile` and `overlay` show the last finished reading; all else is called one at a time.
    `port` 0 is any that is free, `UsageError` where it cannot be had; `browser` opens the page where there is a
    display; `ready` is called with the address as soon as requests are taken.
    """
    token = secrets.token_urlsafe(32)
    desk = Desk(session)
    with contextlib.suppress(KeyboardInterrupt), _listening(port) as listener:
        url = f"http://127.0.0.1:{listener.getsockname()[1]}/?token={token}"

        def begin() -> None:
            print(url, file=sys.stderr, flush=True)
            # in the terminal of an SSH session a browser would take the terminal
            display = sys.platform in ("win32", "darwin") or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
            if browser and display:
                threading.Thread(target=webbrowser.open, args=[url], daemon=True).start()
            if ready is not None:
                ready(url)

        config = uvicorn.Config(
            guarded(desk, token, begin), log_config=None, access_log=False, server_header=False, proxy_headers=False,
            lifespan="on", ws="none", timeout_graceful_shutdown=PATIENCE,
        )  # fmt: skip
        server = uvicorn.Server(config)
        desk.end = lambda: setattr(server, "should_exit", True)
        server.run(sockets=[listener])


def _listening(port: int) -> socket.socket:
    """Listen to this machine alone."""
    remedy = "choose another, or 0 for any that is free"
    if not 0 <= port <= 65535:
        raise UsageError(f"port {port} is none (0 to 65535); {remedy}")
    try:
        return socket.create_server(("127.0.0.1", port))
    except OSError as fault:
        raise UsageError(f"port {port} cannot be had ({fault.strerror}); {remedy}") from None
