"""Who may speak to the studio."""

from __future__ import annotations

from typing import Any

import pytest

from interpose.studio.security import allowed_hosts, headers, refusal

HOSTS = allowed_hosts(8360)
OWN = "http://127.0.0.1:8360"


def scope(kind: str = "http", method: str = "GET", **named: str | list[str] | None) -> dict[str, Any]:
    held = {"host": "127.0.0.1:8360", **named}
    listed = [(name, [value] if isinstance(value, str) else value or []) for name, value in held.items()]
    given = [(name.encode(), value.encode("latin-1")) for name, values in listed for value in values]
    return {"type": kind, "method": method, "headers": given}


def websocket(**named: Any) -> dict[str, Any]:
    made = scope("websocket", **named)
    del made["method"]
    return made


def test_a_server_has_three_names() -> None:
    assert HOSTS == ("127.0.0.1:8360", "localhost:8360", "[::1]:8360")
    assert allowed_hosts(80) == ("127.0.0.1", "localhost", "[::1]")


def test_its_own_page_is_welcome() -> None:
    assert refusal(scope(), HOSTS) is None
    assert refusal(scope(method="HEAD"), HOSTS) is None
    assert refusal(scope(origin=OWN), HOSTS) is None
    assert refusal(scope(host="LOCALHOST:8360"), HOSTS) is None
    assert refusal(scope(method="POST", origin=OWN), HOSTS) is None
    assert refusal(websocket(origin=OWN), HOSTS) is None
    assert refusal(websocket(host="localhost:8360", origin="http://localhost:8360"), HOSTS) is None


BAD_HOSTS = [
    None,
    "",
    "127.0.0.1",
    "127.0.0.1:8361",
    "localhost",
    "evil.example:8360",
    "127.0.0.1:8360.evil.example",
    "127.0.0.1.evil.example:8360",
    "0.0.0.0:8360",
    "user@127.0.0.1:8360",
    ["127.0.0.1:8360", "evil.example"],
    ["127.0.0.1:8360", "127.0.0.1:8360"],
]


@pytest.mark.parametrize("host", BAD_HOSTS)
def test_another_host_is_a_stranger(host: Any) -> None:
    for one in (scope(host=host), scope(host=host, origin=OWN), websocket(host=host, origin=OWN)):
        expected = refusal(one, HOSTS)
        assert expected is not None
        assert "accepts requests to 127.0.0.1:8360, localhost:8360, [::1]:8360 only" in expected


BAD_ORIGINS = [
    "",
    "null",
    "http://evil.example",
    "http://127.0.0.1",
    "http://127.0.0.1:8361",
    "https://127.0.0.1:8360",
    "http://localhost:8360",  # the host is another of its names
    "http://127.0.0.1:8360/",
    "http://127.0.0.1:8360.evil.example",
    [OWN, "http://evil.example"],
]


@pytest.mark.parametrize("origin", BAD_ORIGINS)
def test_another_origin_is_a_stranger(origin: Any) -> None:
    for one in (scope(origin=origin), scope(method="POST", origin=origin), websocket(origin=origin)):
        expected = refusal(one, HOSTS)
        assert expected == "this request is only accepted from the studio's own page, http://127.0.0.1:8360"


def test_what_changes_something_or_stays_open_must_name_its_page() -> None:
    for one in (scope(method="POST"), scope(method="PUT"), scope(method="OPTIONS"), websocket()):
        assert refusal(one, HOSTS) is not None


def test_pages_may_only_speak_to_this_server() -> None:
    told = {name.decode(): value.decode() for name, value in headers(HOSTS)}
    policy = told["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "script-src 'self';" in policy
    assert "connect-src 'self' blob: ws://127.0.0.1:8360 ws://localhost:8360;" in policy
    assert "frame-ancestors 'none'" in policy
    assert told["x-content-type-options"] == "nosniff"
