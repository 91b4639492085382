"""The studio's server as an ASGI application: the routes described in `protocol`, and the built front end."""

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
from interpose.parts import GROUND, GROUPS
from interpose.studio import messages, projects, rigs
from interpose.studio.export import EXPORT, export
from interpose.studio.front import serve_file
from interpose.studio.handlers import answer
from interpose.studio.methods import Offer
from interpose.studio.protocol import LARGEST_UPLOAD, Opened, Refusal, Welcome
from interpose.studio.rigs import RigStore, UnknownRig
from interpose.studio.sample import sample
from interpose.studio.scheduler import INTERNAL_ERROR, MALFORMED, Disconnect, RequestQueue, Serve, WorkerPool
from interpose.studio.security import OriginCheck, allowed_hosts, headers

Result = TypeVar("Result")

MOST_CONNECTIONS = 32
TOO_MANY_CONNECTIONS = 1013
"""Close code of a connection above the limit (RFC 6455)."""
FILE_THREADS = 2
"""Files that are read or written at once."""
DISCARDED = 8 * LARGEST_UPLOAD
"""Bytes of a too large upload that are still read and discarded, so that the browser sees the refusal."""


def create_app(
    port: int,
    offer: Offer,
    *,
    front: Path | None = None,
    opened: Opened | None = None,
    store: RigStore | None = None,
    serve: Serve | None = None,
) -> FastAPI:
    """The application for a server on this port of the loopback.

    front: the folder of the built front end. opened: the file given on the command line. serve: answers the requests of
    the websocket, in place of `handlers.answer` with these models.
    """
    kept = RigStore() if store is None else store
    named = Opened(source=None, project=None) if opened is None else opened
    pool = WorkerPool(partial(answer, store=kept, offer=offer) if serve is None else serve)
    welcome = messages.pack(
        Welcome(
            type="welcome",
            version=version("interpose"),
            methods=offer.methods,
            gallery=offer.gallery_name,
            target_parts=[*GROUPS, GROUND],
        ),
        {},
    )
    heavy = asyncio.Semaphore(FILE_THREADS)
    connections: set[WebSocket] = set()

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        pool.stop()

    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None, lifespan=lifespan)
    hosts = allowed_hosts(port)
    app.add_middleware(OriginCheck, hosts=hosts)

    async def in_thread(function: Callable[..., Result], *given: Any) -> Result:
        async with heavy:
            try:
                return await asyncio.to_thread(function, *given)
            except MemoryError:
                raise HTTPException(507, "not enough memory; use a shorter clip") from None
            except InputError:
                raise
            except Exception:
                traceback.print_exc(file=sys.stderr)
                raise HTTPException(500, INTERNAL_ERROR) from None

    @app.post("/api/rigs")
    async def open_rig(request: Request, name: str = "clip.bvh") -> Response:
        data = await _body(request)

        def parse() -> bytes:
            short = name[:120] or "clip.bvh"
            return messages.pack(*rigs.describe(kept.open(data, short), short))

        return _bytes(await in_thread(parse))

    @app.post("/api/projects")
    async def open_project(request: Request) -> Response:
        data = await _body(request)
        return _json(await in_thread(projects.read, data, kept))

    @app.post("/api/export")
    async def export_motion(request: Request) -> Response:
        data = await _body(request)

        def write() -> bytes:
            header, arrays = messages.unpack(data, EXPORT)
            return export(header, arrays, kept.get(header.rig))

        return _bytes(await in_thread(write))

    @app.get("/api/opened")
    async def opened_file() -> Response:
        return _json(named)

    @app.get("/api/sample")
    async def sample_scene() -> Response:
        return _json(await in_thread(sample))

    @app.websocket("/api/socket")
    async def socket(browser: WebSocket) -> None:
        with suppress(WebSocketDisconnect):  # it disconnected before the handshake
            await browser.accept()
            if len(connections) >= MOST_CONNECTIONS:
                await browser.close(TOO_MANY_CONNECTIONS, f"{MOST_CONNECTIONS} windows are already open; close some")
                return
            connections.add(browser)
            try:
                await _serve_connection(browser, pool, welcome)
            finally:
                connections.discard(browser)

    @app.get("/{path:path}")
    async def page(path: str) -> Response:
        if path == "api" or path.startswith("api/"):
            raise HTTPException(404)
        return await asyncio.to_thread(serve_file, front, path)

    @app.exception_handler(HTTPException)
    async def refused(request: Request, error: HTTPException) -> Response:
        plain = {404: f"{request.url.path[:80]} does not exist", 405: f"{request.method} is not allowed here"}
        return _refusal(error.status_code, plain.get(error.status_code, str(error.detail)))

    @app.exception_handler(InputError)
    async def not_served(_: Request, error: InputError) -> Response:
        return _refusal(409 if isinstance(error, UnknownRig) else 400, str(error), again=isinstance(error, UnknownRig))

    @app.exception_handler(ClientDisconnect)
    async def gone(_: Request, error: ClientDisconnect) -> Response:
        return Response(status_code=400)  # nobody reads it

    @app.exception_handler(Exception)
    async def internal_error(_: Request, error: Exception) -> Response:
        made = _refusal(500, INTERNAL_ERROR)
        made.raw_headers.extend(headers(hosts))  # this response does not pass the middleware
        return made

    return app


async def _serve_connection(browser: WebSocket, pool: WorkerPool, welcome: bytes) -> None:
    """Answers the requests of a connection until either side closes it."""
    await browser.send_bytes(welcome)
    queue = RequestQueue(pool, browser.send_bytes)
    writer = asyncio.create_task(queue.write())
    try:
        while (message := await browser.receive())["type"] == "websocket.receive":
            data = message.get("bytes")
            if data is None:
                raise Disconnect(MALFORMED, "messages must be binary, not text")
            queue.take(data)
    except Disconnect as refused:
        writer.cancel()
        with suppress(RuntimeError, WebSocketDisconnect):  # it has disconnected already
            await browser.close(refused.code, _short(refused.reason))
    finally:
        queue.close()
        writer.cancel()
        with suppress(asyncio.CancelledError, Exception):  # the browser has disconnected
            await writer


async def _body(request: Request) -> bytes:
    """The body. Raises HTTPException if it is too large; then the rest of it is read and discarded."""
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
        raise HTTPException(413, f"the file is larger than the limit of {most} MB; cut it into shorter clips")
    return b"".join(taken)


def _bytes(data: bytes) -> Response:
    return Response(data, media_type="application/octet-stream")


def _json(body: BaseModel, status: int = 200) -> Response:
    return Response(body.model_dump_json(), status, media_type="application/json")


def _refusal(status: int, reason: str, again: bool = False) -> Response:
    return _json(Refusal(reason=reason, again=again), status)


def _short(reason: str) -> str:
    """A reason cut to the 123 bytes of UTF-8 that fit into a close frame."""
    data = reason.encode()
    return reason if len(data) <= 123 else data[:120].decode(errors="ignore") + "…"
