"""The studio's server as an ASGI application: the routes of `protocol`, and the built front end."""

from __future__ import annotations

import asyncio
import sys
import traceback
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from fastapi import FastAPI, Request, Response, WebSocket, WebSocketDisconnect
from pydantic import BaseModel
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from interpose.errors import InputError
from interpose.studio import messages, projects, rigs
from interpose.studio.export import EXPORT, export
from interpose.studio.handlers import answer
from interpose.studio.methods import Sessions, offered
from interpose.studio.protocol import LARGEST_UPLOAD, Opened, Refusal, Welcome
from interpose.studio.rigs import Shelf, Unknown
from interpose.studio.sample import sample
from interpose.studio.scheduler import MALFORMED, Desk, Refused, Serve, Workshop
from interpose.studio.security import Guard, allowed_hosts, headers
from interpose.studio.static import found

Made = TypeVar("Made")

MOST_CONNECTIONS = 32
BUSY = 1013
"""The code that a connection too many is closed with."""
HEAVY = 2
"""Files that are read or written at once."""
_FAULT = "this went wrong in the server, by a fault of its own; the terminal says more"
DISCARDED = 8 * LARGEST_UPLOAD
"""Bytes of an upload that is too large that are still taken, and forgotten, so that the refusal is heard."""


def create_app(
    port: int,
    sessions: Sessions,
    *,
    front: Path | None = None,
    opened: Opened | None = None,
    shelf: Shelf | None = None,
    serve: Serve | None = None,
) -> FastAPI:
    """The application for a server on that port of the loopback.

    front: the folder of the built front end. opened: what the command line named. serve: what answers the questions of
    the websocket, in place of `work.answer` with those models.
    """
    kept = Shelf() if shelf is None else shelf
    named = Opened(source=None, project=None) if opened is None else opened
    workshop = Workshop(partial(answer, shelf=kept, sessions=sessions) if serve is None else serve)
    welcome = messages.pack(Welcome(type="welcome", version=version("interpose"), methods=offered(sessions)), {})
    heavy = asyncio.Semaphore(HEAVY)
    connections: set[WebSocket] = set()

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        workshop.stop()

    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None, lifespan=lifespan)
    hosts = allowed_hosts(port)
    app.add_middleware(Guard, hosts=hosts)

    async def in_thread(work: Callable[..., Made], *given: Any) -> Made:
        async with heavy:
            try:
                return await asyncio.to_thread(work, *given)
            except MemoryError:
                raise HTTPException(507, "there is not enough memory for this; use a shorter clip") from None
            except InputError:
                raise
            except Exception:
                traceback.print_exc(file=sys.stderr)
                raise HTTPException(500, _FAULT) from None

    @app.post("/api/rigs")
    async def open_rig(request: Request, name: str = "clip.bvh") -> Response:
        data = await _body(request)

        def work() -> bytes:
            short = name[:120] or "clip.bvh"
            return messages.pack(*rigs.told(kept.open(data, short), short))

        return _bytes(await in_thread(work))

    @app.post("/api/projects")
    async def open_project(request: Request) -> Response:
        data = await _body(request)
        return _json(await in_thread(projects.read, data, kept))

    @app.post("/api/export")
    async def export_motion(request: Request) -> Response:
        data = await _body(request)

        def work() -> bytes:
            asked, arrays = messages.unpack(data, EXPORT)
            return export(asked, arrays, kept.get(asked.rig))

        return _bytes(await in_thread(work))

    @app.get("/api/opened")
    async def what_was_opened() -> Response:
        return _json(named)

    @app.get("/api/sample")
    async def sample_scene() -> Response:
        return _json(await in_thread(sample))

    @app.websocket("/api/socket")
    async def socket(browser: WebSocket) -> None:
        with suppress(WebSocketDisconnect):  # it has gone before it was greeted
            await browser.accept()
            if len(connections) >= MOST_CONNECTIONS:
                await browser.close(BUSY, f"{MOST_CONNECTIONS} windows are open already; close some")
                return
            connections.add(browser)
            try:
                await _converse(browser, workshop, welcome)
            finally:
                connections.discard(browser)

    @app.get("/{path:path}")
    async def page(path: str) -> Response:
        if path == "api" or path.startswith("api/"):
            raise HTTPException(404)
        return await asyncio.to_thread(found, front, path)

    @app.exception_handler(HTTPException)
    async def refused(request: Request, error: HTTPException) -> Response:
        plain = {404: f"there is nothing at {request.url.path[:80]}", 405: f"{request.method} is not served there"}
        return _refusal(error.status_code, plain.get(error.status_code, str(error.detail)))

    @app.exception_handler(InputError)
    async def not_served(_: Request, error: InputError) -> Response:
        return _refusal(409 if isinstance(error, Unknown) else 400, str(error), again=isinstance(error, Unknown))

    @app.exception_handler(ClientDisconnect)
    async def gone(_: Request, error: ClientDisconnect) -> Response:
        return Response(status_code=400)  # nobody reads it

    @app.exception_handler(Exception)
    async def mishap(_: Request, error: Exception) -> Response:
        made = _refusal(500, _FAULT)
        made.raw_headers.extend(headers(hosts))  # this answer does not pass the guard
        return made

    return app


async def _converse(browser: WebSocket, workshop: Workshop, welcome: bytes) -> None:
    """Questions in and answers out, until the browser goes or is sent away."""
    await browser.send_bytes(welcome)
    desk = Desk(workshop, browser.send_bytes)
    writer = asyncio.create_task(desk.write())
    try:
        while (message := await browser.receive())["type"] == "websocket.receive":
            data = message.get("bytes")
            if data is None:
                raise Refused(MALFORMED, "text came; messages are binary")
            desk.take(data)
    except Refused as refused:
        writer.cancel()
        with suppress(RuntimeError, WebSocketDisconnect):  # it has gone by itself
            await browser.close(refused.code, _short(refused.reason))
    finally:
        desk.close()
        writer.cancel()
        with suppress(asyncio.CancelledError, Exception):  # what could not be sent was for a browser that has gone
            await writer


async def _body(request: Request) -> bytes:
    """The body. Raises HTTPException where it is too large; then what is left of it is taken and forgotten."""
    taken: list[bytes] = []
    size = 0
    async for chunk in request.stream():
        size += len(chunk)
        if size <= LARGEST_UPLOAD:
            taken.append(chunk)
        else:
            taken.clear()
        if size > DISCARDED:
            break
    if size > LARGEST_UPLOAD:
        most = LARGEST_UPLOAD // 2**20
        raise HTTPException(413, f"this is larger than {most} MB, the most that can be sent; cut it into shorter clips")
    return b"".join(taken)


def _bytes(data: bytes) -> Response:
    return Response(data, media_type="application/octet-stream")


def _json(told: BaseModel, status: int = 200) -> Response:
    return Response(told.model_dump_json(), status, media_type="application/json")


def _refusal(status: int, reason: str, again: bool = False) -> Response:
    return _json(Refusal(reason=reason, again=again), status)


def _short(reason: str) -> str:
    """A reason that fits into a closing frame, 123 bytes of UTF-8 at most."""
    data = reason.encode()
    return reason if len(data) <= 123 else data[:120].decode(errors="ignore") + "…"
