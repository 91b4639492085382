"""Who may speak to the studio: only pages that it served itself, and what browsers are told to hold them to.

A page of another site can send requests to the loopback, too, by its own address or by a name that it has pointed there
(DNS rebinding). So every request must name the server by one of its own addresses, and one that comes from a page must
come from the same address; the websocket and whatever is posted must come from a page.
"""

from __future__ import annotations

from collections.abc import Iterable, MutableMapping
from typing import Any

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from interpose.studio.protocol import Refusal

_USUAL = 80
"""The port that browsers do not name."""
_NAMES = ("127.0.0.1", "localhost", "[::1]")


def allowed_hosts(port: int) -> tuple[str, ...]:
    """What a request may call the server."""
    return tuple(name if port == _USUAL else f"{name}:{port}" for name in _NAMES)


class Guard:
    """ASGI middleware: refuses strangers with a status of 403, and adds the security headers to every answer."""

    def __init__(self, app: ASGIApp, hosts: Iterable[str]) -> None:
        self._app = app
        self._hosts = tuple(hosts)
        self._headers = headers(self._hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                message = _with(message, self._headers, scope["path"])
            await send(message)

        reason = stranger(scope, self._hosts)
        if reason is None:
            await self._app(scope, receive, guarded)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": reason})
        else:
            body = Refusal(reason=reason).model_dump_json().encode()
            kind = [(b"content-type", b"application/json"), (b"content-length", str(len(body)).encode())]
            await guarded({"type": "http.response.start", "status": 403, "headers": kind})
            await guarded({"type": "http.response.body", "body": body})


def stranger(scope: MutableMapping[str, Any], hosts: tuple[str, ...]) -> str | None:
    """Why a request is refused, in one sentence; None where it is welcome."""
    given = [value for name, value in scope["headers"] if name == b"host"]
    host = given[0].decode("latin-1").lower() if len(given) == 1 else ""
    if host not in hosts:
        return f"this server answers to {', '.join(hosts)} only; open the address that it printed"
    origins = [value.decode("latin-1").lower() for name, value in scope["headers"] if name == b"origin"]
    needed = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
    if (origins or needed) and origins != [f"http://{host}"]:
        return f"this can only be asked from the studio's own page, http://{host}"
    return None


def headers(hosts: tuple[str, ...]) -> list[tuple[bytes, bytes]]:
    """What browsers are told to hold the pages to."""
    sockets = " ".join(f"ws://{host}" for host in hosts if not host.startswith("["))
    policy = {
        "default-src": "'self'",
        "script-src": "'self'",
        "style-src": "'self' 'unsafe-inline'",
        "img-src": "'self' blob: data:",
        "font-src": "'self' data:",
        "worker-src": "'self' blob:",
        "connect-src": f"'self' blob: {sockets}",
        "object-src": "'none'",
        "base-uri": "'none'",
        "form-action": "'none'",
        "frame-ancestors": "'none'",
    }
    told = {
        "content-security-policy": "; ".join(f"{what} {where}" for what, where in policy.items()),
        "x-content-type-options": "nosniff",
        "referrer-policy": "no-referrer",
        "x-frame-options": "DENY",
        "cross-origin-opener-policy": "same-origin",
        "cross-origin-resource-policy": "same-origin",
    }
    return [(name.encode(), value.encode()) for name, value in told.items()]


def _with(message: Message, headers: list[tuple[bytes, bytes]], path: str) -> Message:
    own = list(message.get("headers", []))
    if path.startswith("/api/") and not any(name.lower() == b"cache-control" for name, _ in own):
        own.append((b"cache-control", b"no-store"))
    return {**message, "headers": own + headers}
