"""Serve the table to the browsers of this machine, from the first page to "Done" or Ctrl-C."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import secrets
import socket
import sys
import threading
import webbrowser
from collections.abc import Callable
from typing import TYPE_CHECKING

from data_schemas.errors import UsageError

if TYPE_CHECKING:
    from pipeline.film.table.session import Session

PATIENCE = 10  # s that requests under way are given when the server ends


def serve(
    session: Session, *, port: int = 0, browser: bool = True, ready: Callable[[str], object] | None = None
) -> None:
    """Serve a session on 127.0.0.1 until the person is done, or Ctrl-C. The address, with its token, goes to stderr.

    Parameters
    ----------
    session : Session
        `tile` and `overlay` are called while an edit may be under way: they show the last finished reading. Of all
        else one is called at a time.
    port : int
        Port to listen on; 0: any that is free.
    browser : bool
        Open the page in a browser, where this machine has a display.
    ready : function, optional
        Called with the address as soon as requests are taken.

    Raises
    ------
    UsageError
        The extra `table` is not installed, or the port cannot be had.
    """
    if any(importlib.util.find_spec(name) is None for name in ("starlette", "uvicorn")):
        raise UsageError("the table needs starlette and uvicorn; pip install 'isochrony[table]'")
    import uvicorn

    from pipeline.film.table.app import Desk, guarded

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
