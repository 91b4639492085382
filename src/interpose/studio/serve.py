"""Starts the studio's server on the loopback and opens a browser; runs until interrupted."""

from __future__ import annotations

import os
import socket
import sys
import threading
import webbrowser
from contextlib import suppress
from pathlib import Path

import uvicorn

from interpose.errors import InputError
from interpose.studio.app import create_app
from interpose.studio.methods import Offer, warm
from interpose.studio.protocol import LARGEST_MESSAGE, Opened

PORT = 8360
PORTS_TRIED = 20
"""Number of ports from :data:`PORT` on to try before taking any free one."""
_LOOPBACK = "127.0.0.1"


def serve(opened: Opened, front: Path | None, port: int | None, browse: bool, offer: Offer) -> int:
    """Serves until interrupted and returns the exit status. Raises InputError if the port is not available."""
    listening = listen(port)
    number = listening.getsockname()[1]
    app = create_app(number, offer, front=front, opened=opened)
    address = f"http://{_LOOPBACK}:{number}"
    print(f"The studio is running at {address} (press Ctrl+C to stop it).", file=sys.stderr, flush=True)
    threading.Thread(target=_warm, args=(offer,), daemon=True).start()
    if browse:
        threading.Thread(target=_browse, args=(address,), daemon=True).start()
    config = uvicorn.Config(
        app,
        log_level="error",
        access_log=False,
        server_header=False,
        ws_max_size=2 * LARGEST_MESSAGE,  # messages between one and two limits get a readable refusal
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=2,
    )
    with suppress(KeyboardInterrupt):
        uvicorn.Server(config).run(sockets=[listening])
    return 0


def listen(port: int | None) -> socket.socket:
    """A socket on that port of the loopback, or on the first free one from :data:`PORT` on.

    Raises InputError if the given port is not available.
    """
    if port is not None:
        if not 0 <= port <= 65535:
            raise InputError(f"--port must be 0 to 65535, got {port}")
        try:
            return socket.create_server((_LOOPBACK, port), backlog=128)
        except OSError as error:
            why = os.strerror(error.errno or 0).lower()
            raise InputError(f"port {port} is not available ({why}); leave out --port, or choose another") from None
    for one in (*range(PORT, PORT + PORTS_TRIED), 0):
        try:
            return socket.create_server((_LOOPBACK, one), backlog=128)
        except OSError:
            continue
    raise InputError("no free port on this machine; close a program that uses one")


def _warm(offer: Offer) -> None:
    try:
        warm(offer)
    except InputError as error:
        print(f"interpose: {error}", file=sys.stderr, flush=True)


def _browse(address: str) -> None:
    """Opens a browser if there is a display. The address is printed in any case."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return
    with suppress(Exception):  # the address has been printed already
        webbrowser.open(address)
