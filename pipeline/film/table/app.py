"""What the server of the table answers: to whom (`guarded`), and what (`Desk`)."""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import json
import re
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from data_schemas.errors import IsochronyError
from pipeline.flag_words import FLAGS, told

if TYPE_CHECKING:
    from pipeline.film.table.session import Session

_T = TypeVar("_T")
_MOST_BYTES = 2**20  # of what is posted: an edit has some hundreds
_MOST_ROWS = 10_000  # of an overlay
_TILE = 512  # px
_HERE = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:\d{1,5})?", re.IGNORECASE)  # any port: tunnels map them
_PAGE = ("page.html", "page.css", "page.svg", "page.js", "panels.js", "film.js", "axis.js", "ask.js")
_KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}
_BUSY = "the film is being read anew; wait until that is done"


class Desk:
    """Brings requests to the session: changes one after the other in one thread, looking in another."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.end: Callable[[], object] = lambda: None
        self._busy = False
        self._worker, self._looker = ThreadPoolExecutor(1, "table-edit"), ThreadPoolExecutor(1, "table-look")
        self._state = self._worker.submit(session.state).result()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._looker.shutdown(cancel_futures=True)
        self._worker.shutdown()

    def routes(self) -> list[Route]:
        """Every address with what answers it."""
        steps = {name: partial(self._step, getattr(self.session, name)) for name in ("undo", "redo")}
        posted: dict[str, Callable[..., Any]] = {"edits": self._edits, "who": self._who, "done": self._done, **steps}
        return [
            Route("/state", self._now),
            Route("/overlay", self._overlay),
            Route("/times", self._times),
            Route("/tile/{level:int}/{down:int}/{across:int}", self._tile),
            Route("/readings.csv", self._csv),
            *(Route(f"/{name}", answer, methods=["POST"]) for name, answer in posted.items()),
        ]

    async def _in(self, pool: ThreadPoolExecutor, call: Callable[..., _T], *given: Any) -> _T:
        return await asyncio.get_running_loop().run_in_executor(pool, call, *given)

    async def _now(self, _: Request) -> Response:
        """The state: of the last finished reading while an edit is under way, otherwise as gravity is by now."""
        if not self._busy:
            self._state = await self._in(self._worker, self.session.state)
        return self._told()

    def _told(self) -> Response:
        state, session = self._state, self.session
        words = {flag: told(flag) for flag in state["reading"]["flags"] if flag in FLAGS}
        extra = {"busy": self._busy, "who": session.who, "levels": session.levels, "flag_words": words}
        return JSONResponse(state | extra)

    async def _overlay(self, request: Request) -> Response:
        try:
            first, last, most = (int(request.query_params[name]) for name in ("first", "last", "most"))
        except (KeyError, ValueError):
            raise HTTPException(400, "overlay wants whole numbers first, last and most") from None
        rows = self._state["rows"]
        if not (0 <= first < last <= rows and 1 <= most <= _MOST_ROWS):
            raise HTTPException(400, f"overlay wants 0 <= first < last <= {rows} and 1 <= most <= {_MOST_ROWS}")
        return JSONResponse(await self._in(self._looker, self.session.overlay, first, last, most))

    async def _times(self, _: Request) -> Response:
        """Rows of all marks on the first trace, with their labels."""
        shown = await self._in(self._looker, self.session.overlay, 0, self._state["rows"], _MOST_ROWS)
        return JSONResponse([[mark["row"], mark["label"]] for mark in shown["marks"]])

    async def _tile(self, request: Request) -> Response:
        level, down, across = (request.path_params[name] for name in ("level", "down", "across"))
        size = _TILE << min(level, 30)
        here = down * size < self._state["rows"] and across * size < self._state["columns"]
        if level >= self.session.levels or not here:
            raise HTTPException(404, "the film has no such tile")
        image = await self._in(self._looker, self.session.tile, level, down, across)
        return Response(image, media_type="image/png", headers={"Cache-Control": "private, max-age=86400"})

    async def _csv(self, _: Request) -> Response:
        table = await self._in(self._worker, self.session.csv)
        return Response(table, media_type="text/csv", headers={"Content-Disposition": "attachment"})

    async def _edits(self, request: Request) -> Response:
        """Make one edit, or several as one step: all or none."""
        edits = (await _content(request)).get("edits")
        if not (isinstance(edits, list) and 1 <= len(edits) <= 9 and all(isinstance(each, dict) for each in edits)):
            raise HTTPException(400, "edits wants a list of one edit or a few")
        return await self._changed(self.session.edit, *edits)

    async def _step(self, change: Callable[[], dict[str, Any]], request: Request) -> Response:
        await _content(request)
        return await self._changed(change)

    async def _changed(self, change: Callable[..., dict[str, Any]], *given: dict[str, Any]) -> Response:
        """The state after a change, unless another is under way."""
        if self._busy:
            raise HTTPException(409, _BUSY)
        self._busy = True
        try:
            self._state = await self._in(self._worker, change, *given)
        finally:
            self._busy = False
        return self._told()

    async def _who(self, request: Request) -> Response:
        name = (await _content(request)).get("who")
        if not (isinstance(name, str) and len(name.strip()) <= 100):
            raise HTTPException(400, "who wants a name of at most 100 letters")
        await self._in(self._worker, setattr, self.session, "who", name.strip())
        return self._told()

    async def _done(self, request: Request) -> Response:
        await _content(request)
        if self._busy:
            raise HTTPException(409, _BUSY)
        self.end()
        return JSONResponse({"saved": self._state["saved"]})


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
    """Answer requests that come from this machine's own pages and bring the token; refuse all others.

    `begin` is called when the first request may come, and Ctrl-C is heeded.
    """
    folder = Path(__file__).parent
    page = {name: (folder / name).read_text(encoding="utf-8").replace("TOKEN", token) for name in _PAGE}

    def static(name: str) -> Route:
        path = "/" if name == "page.html" else f"/{name}"
        return Route(path, lambda _: Response(page[name], media_type=_KINDS[Path(name).suffix]))

    def line(_: Request, fault: Exception) -> Response:
        if isinstance(fault, HTTPException):
            return JSONResponse({"error": fault.detail}, fault.status_code, fault.headers)
        return JSONResponse({"error": str(fault)}, 422)

    @contextlib.asynccontextmanager
    async def begun(_: Starlette) -> AsyncIterator[None]:
        begin()
        yield

    routes, faults = [*map(static, _PAGE), *desk.routes()], {HTTPException: line, IsochronyError: line}
    app = Starlette(routes=routes, exception_handlers=faults, lifespan=begun)

    async def guard(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            return await app(scope, receive, send)

        async def told_more(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update(_HEADERS)
                headers.setdefault("Cache-Control", "no-store")
            await send(message)

        refusal = _refusal(Request(scope), token)
        answer = app if refusal is None else JSONResponse({"error": refusal[1]}, refusal[0])
        return await answer(scope, receive, told_more)

    return guard


def _refusal(request: Request, token: str) -> tuple[int, str] | None:
    """Status and reason, where a request is refused."""
    headers: Headers = request.headers
    if not _HERE.fullmatch(headers.get("host", "")):
        return 400, "this server answers to 127.0.0.1 and localhost alone"
    origin = headers.get("origin")
    if origin is not None and not (origin.startswith("http://") and _HERE.fullmatch(origin.removeprefix("http://"))):
        return 403, "requests of other pages are refused"
    given = headers.get("x-token") or (request.query_params.get("token", "") if request.method == "GET" else "")
    if not hmac.compare_digest(given.encode(), token.encode()):
        return 403, "the token is missing or wrong: open the address that isochrony printed"
    return None
