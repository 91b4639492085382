"""Where the studio listens."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import pytest

from interpose.errors import InputError
from interpose.studio import serve
from interpose.studio.methods import Offer
from interpose.studio.protocol import Opened


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as made:
        yield made


def had(stack: ExitStack, port: int | None) -> socket.socket:
    return stack.enter_context(closing(serve.listen(port)))


@pytest.fixture
def busy(stack: ExitStack) -> int:
    """A port that something else listens on."""
    taken = stack.enter_context(closing(socket.socket()))
    taken.bind(("127.0.0.1", 0))
    taken.listen()
    return taken.getsockname()[1]


def test_it_listens_on_the_loopback_only(stack: ExitStack) -> None:
    made = had(stack, 0)
    address, port = made.getsockname()
    assert address == "127.0.0.1"
    assert port > 0
    stack.enter_context(closing(socket.create_connection(("127.0.0.1", port), 5)))


def test_a_port_that_is_asked_for_is_had(stack: ExitStack) -> None:
    with closing(serve.listen(0)) as free:
        port = free.getsockname()[1]
    assert had(stack, port).getsockname()[1] == port


def test_a_busy_port_is_told(busy: int) -> None:
    with pytest.raises(InputError, match=rf"port {busy} is not available \(.*in use.*\); leave out --port"):
        serve.listen(busy)


@pytest.mark.parametrize("port", [-1, 65536, 10**9])
def test_a_port_that_is_none_is_told(port: int) -> None:
    with pytest.raises(InputError, match=f"--port must be 0 to 65535, got {port}"):
        serve.listen(port)


def test_where_none_is_asked_for_the_next_free_is_taken(
    stack: ExitStack, busy: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[int] = []

    def listening(address: tuple[str, int], backlog: int) -> socket.socket:
        tried.append(address[1])
        if address[1] in (busy, busy + 1):
            raise OSError(98, "Address already in use")
        return real(("127.0.0.1", 0), backlog=backlog)

    real = socket.create_server
    monkeypatch.setattr(serve, "PORT", busy)
    monkeypatch.setattr(socket, "create_server", listening)
    had(stack, None)
    assert tried == [busy, busy + 1, busy + 2]


def test_where_all_of_them_are_busy_any_is_taken(stack: ExitStack, busy: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serve, "PORT", busy)
    monkeypatch.setattr(serve, "PORTS_TRIED", 1)
    assert had(stack, None).getsockname()[1] != busy
    monkeypatch.setattr(socket, "create_server", lambda *_, **__: (_ for _ in ()).throw(OSError()))
    with pytest.raises(InputError, match="no free port on this machine"):
        serve.listen(None)


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What `serve.serve` would run: nothing is served, and no browser opened."""
    seen: dict[str, Any] = {}

    class Server:
        def __init__(self, config: Any) -> None:
            seen["config"] = config

        def run(self, sockets: list[socket.socket]) -> None:
            seen["address"] = sockets[0].getsockname()
            sockets[0].close()
            raise KeyboardInterrupt

    monkeypatch.setattr(serve.uvicorn, "Server", Server)
    monkeypatch.setattr(serve.webbrowser, "open", lambda address: seen.setdefault("opened", address))
    monkeypatch.setenv("DISPLAY", ":0")
    return seen


def test_the_address_is_printed_and_ctrl_c_is_no_fault(
    started: dict[str, Any], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert serve.serve(Opened(source=None, project=None), tmp_path, 0, browse=False, offer=Offer(models=())) == 0
    host, port = started["address"]
    expected = capsys.readouterr()
    assert f"The studio is running at http://{host}:{port} (press Ctrl+C to stop it)." in expected.err
    assert expected.out == ""
    config = started["config"]
    assert not config.server_header
    assert config.ws_max_size >= serve.LARGEST_MESSAGE
    assert "opened" not in started


def test_a_browser_is_opened_where_there_is_a_screen(started: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serve.sys, "platform", "linux")
    serve._browse("http://127.0.0.1:1")
    assert started["opened"] == "http://127.0.0.1:1"
    del started["opened"]
    monkeypatch.delenv("DISPLAY")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    serve._browse("http://127.0.0.1:1")
    assert "opened" not in started


def test_whatever_goes_wrong_in_a_browser_is_left_alone(
    started: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(_: str) -> None:
        raise RuntimeError

    monkeypatch.setattr(serve.webbrowser, "open", fails)
    serve._browse("http://127.0.0.1:1")


def test_a_model_that_cannot_be_loaded_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(_: object) -> None:
        raise InputError("the model is broken")

    monkeypatch.setattr(serve, "warm", fails)
    serve._warm(Offer(models=()))
    assert capsys.readouterr().err == "interpose: the model is broken\n"
