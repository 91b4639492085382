"""Accepts requests from the studio's own pages only, and sets security headers.

Pages of other sites can also send requests to the loopback, by its address or by a host name that resolves to it (DNS
rebinding). Therefore the Host header must be one of the server's own, an Origin header must match it, and the websocket
and POST requests must have an Origin.
"""

from __future__ import annotations

from collections.abc import Iterable, MutableMapping
from typing import Any

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from interpose.studio.protocol import Refusal

_HTTP_PORT = 80
"""The port that browsers leave out of Host."""
_HOST_NAMES = ("127.0.0.1", "localhost", "[::1]")


def allowed_hosts(port: int) -> tuple[str, ...]:
    """The Host headers that are accepted."""
    return tuple(name if port == _HTTP_PORT else f"{name}:{port}" for name in _HOST_NAMES)


class OriginCheck:
    """ASGI middleware: refuses foreign requests with status 403, and adds the security headers to every response."""

    def __init__(self, app: ASGIApp, hosts: Iterable[str]) -> None:
        self._app = app
        self._hosts = tuple(hosts)
        self._headers = headers(self._hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = list(message.get("headers", []))
                if scope["path"].startswith("/api/") and not any(name.lower() == b"cache-control" for name, _ in own):
                    own.append((b"cache-control", b"no-store"))
                message = {**message, "headers": own + self._headers}
            await send(message)

        reason = refusal(scope, self._hosts)
        if reason is None:
            await self._app(scope, receive, send_with_headers)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": reason})
        else:
            body = Refusal(reason=reason).model_dump_json().encode()
            kind = [(b"content-type", b"application/json"), (b"content-length", str(len(body)).encode())]
            await send_with_headers({"type": "http.response.start", "status": 403, "headers": kind})
            await send_with_headers({"type": "http.response.body", "body": body})


def refusal(scope: MutableMapping[str, Any], hosts: tuple[str, ...]) -> str | None:
    """Why a request is refused, in one sentence; None if it is accepted."""
    given = [value for name, value in scope["headers"] if name == b"host"]
    host = given[0].decode("latin-1").lower() if len(given) == 1 else ""
    if host not in hosts:
        return f"this server accepts requests to {', '.join(hosts)} only; open the address that it printed"
    origins = [value.decode("latin-1").lower() for name, value in scope["headers"] if name == b"origin"]
    needed = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
    if (origins or needed) and origins != [f"http://{host}"]:
        return f"this request is only accepted from the studio's own page, http://{host}"
    return None


def headers(hosts: tuple[str, ...]) -> list[tuple[bytes, bytes]]:
    """The security headers of every response."""
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
    values = {
        "content-security-policy": "; ".join(f"{what} {where}" for what, where in policy.items()),
        "x-content-type-options": "nosniff",
        "referrer-policy": "no-referrer",
        "x-frame-options": "DENY",
        "cross-origin-opener-policy": "same-origin",
        "cross-origin-resource-policy": "same-origin",
    }
    return [(name.encode(), value.encode()) for name, value in values.items()]
