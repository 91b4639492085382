"""The server over HTTP and the websocket, hostile callers included."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter
from pygltflib import GLTF2
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect
from studio_rigs import HOST, OWN, PORT, envelope, question, walk

from interpose import io
from interpose.studio import app as apps
from interpose.studio import messages, pose_rows
from interpose.studio import scheduler as scheduler
from interpose.studio.app import create_app
from interpose.studio.methods import Offer
from interpose.studio.project_format import Project, SourceFile
from interpose.studio.protocol import SERVER_MESSAGE, Candidates, Failed, MirroredPose, Opened, Rig, Welcome
from interpose.studio.rigs import RigStore
from interpose.studio.sample import sample

BVH = io.serialize(walk(), "clip.bvh")
FOREIGN = {**HOST, "origin": "http://evil.example"}

NOTHING = Offer(models=())


def served(**given: Any) -> TestClient:
    return TestClient(
        create_app(PORT, given.pop("offer", NOTHING), **given), headers=OWN, base_url=f"http://127.0.0.1:{PORT}"
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    page = tmp_path / "page"
    page.mkdir()
    (page / "index.html").write_text("<title>Page</title>")
    (tmp_path / "secret.html").write_text("secret")
    (page / "link.html").symlink_to(tmp_path / "secret.html")
    return page


@pytest.fixture
def client(folder: Path) -> Iterator[TestClient]:
    with served(front=folder) as made:
        yield made


def opened(client: TestClient, data: bytes = BVH, name: str = "walk.bvh") -> tuple[Rig, dict[str, np.ndarray]]:
    answer = client.post("/api/rigs", params={"name": name}, content=data)
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "application/octet-stream"
    return messages.unpack(answer.content, TypeAdapter(Rig))


def export(client: TestClient, rig: str, frames: np.ndarray, kind: str = "bvh", same: Any = ()) -> Any:
    header = {"rig": rig, "format": kind, "rows": list(same), "arrays": {"frames": list(frames.shape)}}
    return client.post("/api/export", content=envelope(header, frames))


def refusal(answer: Any, status: int) -> str:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/json"
    held = answer.json()
    assert set(held) == {"reason", "again"}
    assert "\n" not in held["reason"]
    return held["reason"]


# HTTP


def test_a_file_is_opened_and_told_of(client: TestClient) -> None:
    rig, arrays = opened(client)
    assert rig.name == "walk.bvh"
    np.testing.assert_allclose(arrays["frames"], pose_rows.of_motion(walk()), atol=1e-5)
    assert opened(client, name="other.bvh")[0].id == rig.id


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", "the file is empty"),
        (b"\x89PNG\r\n\x1a\n\0\0", "not a BVH file"),
        (b"HIERARCHY\nROOT Hips\n{\n", "broken.bvh"),
        (BVH.replace(b"Frames: 4", b"Frames: 5"), "broken.bvh"),
        (BVH.replace(b"Frames: 4", b"Frames: 99999999999"), "broken.bvh"),
        (BVH[: len(BVH) // 2], "broken.bvh"),
        (BVH.replace(b"CHANNELS 3", b"CHANNELS 9", 1), "broken.bvh"),
        (BVH.rstrip()[:-3] + b"nan", "broken.bvh"),
    ],
)
def test_a_broken_file_is_refused_in_words(client: TestClient, data: bytes, expected: str) -> None:
    assert expected in refusal(client.post("/api/rigs", params={"name": "broken.bvh"}, content=data), 400)


def test_a_file_without_a_name_or_with_a_long_one_has_one(client: TestClient) -> None:
    assert client.post("/api/rigs", content=b"").json()["reason"].startswith("clip.bvh")
    assert opened(client, name="")[0].name == "clip.bvh"
    assert opened(client, name="é" * 500)[0].name == "é" * 120


def test_what_is_too_large_is_refused(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apps, "LARGEST_UPLOAD", 2**20)
    monkeypatch.setattr(apps, "DISCARDED", 3 * 2**20)
    for path in ("/api/rigs", "/api/projects", "/api/export"):
        for size in (2**20 + 1, 5 * 2**20):
            assert "limit of 1 MB" in refusal(client.post(path, content=b"\0" * size), 413)
        assert client.post(path, content=b"\0" * 2**20).status_code == 400


def test_an_upload_in_pieces_without_a_length_is_counted_too(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(apps, "LARGEST_UPLOAD", 1000)
    assert refusal(client.post("/api/rigs", content=(b"x" * 100 for _ in range(11))), 413)


def test_a_motion_is_exported_its_claimed_rows_digit_for_digit(client: TestClient) -> None:
    rig, arrays = opened(client)
    frames = arrays["frames"][[0, 1, 1, 3]]
    frames[2, 0] += 0.25
    answer = export(client, rig.id, frames, same=[[0, 0], [1, 1], [2, 1], [3, 3]])
    assert answer.status_code == 200
    made, given = (data.decode().split("Frame Time:")[1].splitlines()[1:] for data in (answer.content, BVH))
    assert [made[0], made[1], made[3]] == [given[0], given[1], given[3]]
    assert made[2] != given[1]
    again = io.parse(answer.content, "it")
    assert again.root_positions[2, 0] == pytest.approx(frames[2, 0], abs=1e-5)


def test_a_glb_is_exported(client: TestClient) -> None:
    rig, arrays = opened(client)
    file = GLTF2.load_from_bytes(export(client, rig.id, arrays["frames"], "glb").content)
    assert {file.accessors[sampler.input].count for sampler in file.animations[0].samplers} == {4}


def test_an_export_of_a_rig_that_is_not_there_asks_for_its_file_again(client: TestClient) -> None:
    _, arrays = opened(client)
    answer = export(client, "f" * 32, arrays["frames"])
    assert "open its file again" in refusal(answer, 409)
    assert answer.json()["again"] is True


def test_an_export_that_is_none_is_refused_in_words(client: TestClient) -> None:
    rig, arrays = opened(client)
    frames = arrays["frames"]
    for answer in (
        client.post("/api/export", content=b""),
        client.post("/api/export", content=b"{}"),
        export(client, rig.id, frames, "fbx"),
        export(client, rig.id, frames[:, :-1]),
        export(client, rig.id, frames * np.float32(np.nan)),
        export(client, rig.id, frames * np.float32(2.0)),
        export(client, rig.id, frames, same=[[0, 4]]),
    ):
        refusal(answer, 400)
        assert answer.json()["again"] is False


def test_the_sample_is_served_and_a_project_is_checked(client: TestClient) -> None:
    answer = client.get("/api/sample")
    assert Project.model_validate_json(answer.content) == sample()
    again = client.post("/api/projects", content=answer.content)
    assert again.status_code == 200
    assert again.json() == answer.json()
    held = answer.json()
    held["keys"][2]["frame"] = 1
    expected = refusal(client.post("/api/projects", content=json.dumps(held).encode()), 400)
    assert "keys[2].frame is 1, not after 39 of the previous key" in expected
    assert client.get("/api/rigs").status_code in (404, 405)


def test_an_opened_project_leaves_its_rig_on_the_shelf(client: TestClient) -> None:
    client.post("/api/projects", content=client.get("/api/sample").content)
    text = sample().source.text.encode()
    rig, arrays = opened(client, text)
    assert export(client, rig.id, arrays["frames"]).status_code == 200


def test_what_the_command_line_named_is_told() -> None:
    with served() as client:
        assert client.get("/api/opened").json() == {"source": None, "project": None}
    named = Opened(source=SourceFile(name="a.bvh", text="x"), project=None)
    with served(opened=named) as client:
        assert Opened.model_validate_json(client.get("/api/opened").content) == named


HOSTILE = ["/docs", "/redoc", "/openapi.json", "/api", "/api/", "/api/none", "/api/rigs/../../secret.html"]
OUTSIDE = ["/%2e%2e/secret.html", "/..%2fsecret.html", "/%2fetc/passwd", "//etc/passwd", "/link.html", "/secret.html"]
ODD = ["/index.html%00", "/" + "a" * 300, "/%c3%28.html", "/..%5csecret.html"]


@pytest.mark.parametrize("path", HOSTILE + OUTSIDE + ODD)
def test_there_is_nothing_else(client: TestClient, path: str) -> None:
    answer = client.get(f"http://127.0.0.1:{PORT}{path}")
    assert "does not exist" in refusal(answer, 404)
    assert "secret" not in answer.text or "secret.html" in path


def test_methods_that_are_not_served_are_told(client: TestClient) -> None:
    assert refusal(client.delete("/api/sample"), 405) == "DELETE is not allowed here"
    assert refusal(client.post("/"), 405)
    assert refusal(client.get("/api/export"), 404)


def test_the_page_is_served_and_not_kept(client: TestClient) -> None:
    answer = client.get("/")
    assert answer.text == "<title>Page</title>"
    assert answer.headers["cache-control"] == "no-cache"
    assert client.get("/api/sample").headers["cache-control"] == "no-store"


def test_without_a_front_end_it_says_so() -> None:
    with served() as client:
        assert "without its front end" in refusal(client.get("/"), 503)


def broken(*_: object, **__: object) -> None:
    raise ZeroDivisionError("secret")


def guarded(answer: Any) -> None:
    for name in ("content-security-policy", "x-content-type-options", "referrer-policy", "x-frame-options"):
        assert len(answer.headers.get_list(name)) == 1, (answer.url, name)
    assert "'unsafe-eval'" not in answer.headers["content-security-policy"]
    assert answer.headers["x-frame-options"] == "DENY"
    assert answer.headers["cross-origin-resource-policy"] == "same-origin"


def test_every_answer_has_the_headers_that_guard_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    app = create_app(PORT, NOTHING, front=folder)
    with TestClient(app, headers=OWN, base_url=f"http://127.0.0.1:{PORT}", raise_server_exceptions=False) as client:
        for path in ("/", "/none", "/api/sample", "/api/none"):
            guarded(client.get(path))
        guarded(client.get("/", headers={"host": "evil"}))
        guarded(client.get("/", headers={"origin": "null"}))
        guarded(client.post("/api/rigs", content=b""))
        guarded(client.post("/api/rigs", content=BVH))
        guarded(client.delete("/"))
        monkeypatch.setattr(apps, "LARGEST_UPLOAD", 10)
        guarded(client.post("/api/rigs", content=BVH))
        monkeypatch.undo()
        monkeypatch.setattr(apps.rigs, "describe", broken)
        answer = client.post("/api/rigs", content=BVH)
        assert "internal server error" in refusal(answer, 500)
        guarded(answer)
        monkeypatch.setattr(apps, "serve_file", broken)
        answer = client.get("/")
        assert "internal server error" in refusal(answer, 500)
        guarded(answer)
    assert "Traceback" in capsys.readouterr().err


def test_too_little_memory_is_told(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(apps.rigs, "describe", full)
    assert "not enough memory" in refusal(client.post("/api/rigs", content=BVH), 507)


def test_a_browser_that_goes_in_the_middle_of_an_upload_is_no_fault() -> None:
    app = create_app(PORT, NOTHING)
    scope = {
        "type": "http", "method": "POST", "path": "/api/rigs", "raw_path": b"/api/rigs", "query_string": b"",
        "headers": [(name.encode(), value.encode()) for name, value in OWN.items()], "root_path": "",
        "http_version": "1.1", "scheme": "http", "asgi": {"version": "3.0"}, "client": None, "server": None,
    }  # fmt: skip

    async def receive() -> dict[str, Any]:
        return {"type": "http.disconnect"}

    async def send(_: Any) -> None:
        return

    asyncio.run(app(scope, receive, send))


@pytest.mark.parametrize("path", ["/", "/api/opened", "/api/sample", "/none"])
def test_strangers_are_refused_before_anything_is_done(client: TestClient, path: str) -> None:
    for changed in ({"host": "evil.example"}, {"host": "127.0.0.1:1"}, {"origin": "null"}, {"origin": "http://a.b"}):
        expected = refusal(client.get(path, headers=changed), 403)
        assert "only" in expected


@pytest.mark.parametrize("path", ["/api/rigs", "/api/projects", "/api/export"])
def test_what_is_posted_must_come_from_the_page(folder: Path, path: str) -> None:
    app = create_app(PORT, NOTHING, front=folder)
    with TestClient(app, base_url=f"http://127.0.0.1:{PORT}") as client:
        assert refusal(client.post(path, content=BVH), 403)
        assert refusal(client.post(path, content=BVH, headers={"origin": "null"}), 403)
        assert client.get("/").status_code == 200


# The websocket


def socket(client: TestClient, **headers: str) -> Any:
    return client.websocket_connect("/api/socket", headers=headers)


def told(ws: Any) -> Any:
    return messages.unpack(ws.receive_bytes(), SERVER_MESSAGE)[0]


def closed(ws: Any) -> tuple[int, str]:
    """Receives until the connection is closed: the code and the reason."""
    with pytest.raises(WebSocketDisconnect) as caught:
        all(iter(ws.receive_bytes, None))
    assert len(caught.value.reason.encode()) <= 123
    return caught.value.code, caught.value.reason


def mirror(rig: str) -> bytes:
    return question("mirror", rig, {"pose": pose_rows.of_motion(walk())[1:2]})


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": ""},
        {"origin": "http://127.0.0.1:1"},
        {"origin": f"http://localhost:{PORT}"},
        {"host": "evil.example"},
        {"host": "127.0.0.1"},
        {"host": f"evil.example:{PORT}", "origin": f"http://evil.example:{PORT}"},
    ],
)
def test_a_stranger_gets_no_connection(client: TestClient, headers: dict[str, str]) -> None:
    with pytest.raises(WebSocketDisconnect) as caught, socket(client, **headers):
        pass
    assert caught.value.code == 1008


def test_a_connection_without_an_origin_is_refused() -> None:
    with (
        TestClient(create_app(PORT, NOTHING), base_url=f"http://127.0.0.1:{PORT}") as client,
        pytest.raises(WebSocketDisconnect) as caught,
        client.websocket_connect("/api/socket", headers=HOST),
    ):
        pass
    assert caught.value.code == 1008


def test_a_connection_is_greeted(models: Offer) -> None:
    with served(offer=models) as client, socket(client) as ws:
        welcome = told(ws)
        assert isinstance(welcome, Welcome)
        assert welcome.methods == models.methods
        assert welcome.gallery is None
        assert {"hips", "hands", "ground"} <= set(welcome.target_parts)


def test_questions_are_answered(models: Offer) -> None:
    with served(offer=models) as client:
        rig, arrays = opened(client)
        with socket(client) as ws:
            told(ws)
            ws.send_bytes(mirror(rig.id))
            assert isinstance(told(ws), MirroredPose)
            keys = {"start": arrays["frames"][1:2], "target": arrays["frames"][2:3]}
            settings = {"method": "dcmoe", "variants": 2}
            ws.send_bytes(question("generate", rig.id, keys, gap="g", frames=20, settings=settings))
            header, made = messages.unpack(ws.receive_bytes(), SERVER_MESSAGE)
            assert isinstance(header, Candidates)
            assert made["frames"].shape == (2, 20, 91)
            ws.send_bytes(mirror("none"))
            missing = told(ws)
            assert isinstance(missing, Failed)
            assert missing.again


CANCEL = envelope({"type": "cancel", "gap": "g"})
WRONG: list[tuple[Callable[[Any], None], int, str]] = [
    (lambda ws: ws.send_bytes(b""), 1007, "the message has 0 bytes"),
    (lambda ws: ws.send_bytes(b"\xff\xff\xff\xff{}"), 1007, "the header should have 4294967295 bytes"),
    (lambda ws: ws.send_bytes(envelope({})), 1007, "type is missing"),
    (lambda ws: ws.send_bytes(envelope("[" * 100_000)), 1007, "it is not valid JSON"),
    (lambda ws: ws.send_bytes(envelope({"type": "x" * 1000})), 1007, "type must be one of"),
    (lambda ws: ws.send_bytes(mirror("a") + b"\0"), 1007, "bytes"),
    (lambda ws: ws.send_bytes(question("mirror", "a", {"pose": np.full((1, 91), np.nan)})), 1007, "NaN or infinite"),
    (
        lambda ws: ws.send_bytes(envelope({"type": "mirror", "id": 1, "rig": "a", "arrays": {"p": [0, 2**30, 2**30]}})),
        1007,
        "the array 'p' has the impossible shape",
    ),
    (lambda ws: ws.send_text("{}"), 1007, "messages must be binary, not text"),
    (lambda ws: ws.send_bytes(b"\0" * (scheduler.LARGEST_MESSAGE + 1)), 1009, "the limit is 4194304"),
    (
        lambda ws: [ws.send_bytes(envelope({"type": "cancel", "gap": "g"})) for _ in range(400)],
        1008,
        "too many messages",
    ),
]


@pytest.mark.parametrize(("send", "code", "expected"), WRONG, ids=[expected for *_, expected in WRONG])
def test_a_hostile_message_closes_its_connection_with_a_reason_and_no_other(
    client: TestClient, send: Callable[[Any], None], code: int, expected: str
) -> None:
    rig, _ = opened(client)
    with socket(client) as other:
        told(other)
        with socket(client) as ws:
            told(ws)
            send(ws)
            got, reason = closed(ws)
            assert got == code
            assert expected in reason
        other.send_bytes(mirror(rig.id))
        assert isinstance(told(other), MirroredPose)
        with socket(client) as again:
            assert isinstance(told(again), Welcome)


def test_work_for_a_connection_that_is_closed_is_dropped_and_others_go_on() -> None:
    gate, began = threading.Event(), threading.Event()

    def serve(message: Any, arrays: Any) -> Any:
        if message.rig == "slow":
            began.set()
            assert gate.wait(20.0)
        return MirroredPose(type="mirrored", id=message.id, arrays={}), {}

    with served(serve=serve) as client, socket(client) as other:
        told(other)
        with socket(client) as ws:
            told(ws)
            ws.send_bytes(question("mirror", "slow"))
            assert began.wait(20.0)
            ws.send_bytes(b"")
            assert closed(ws)[0] == 1007
        other.send_bytes(question("mirror", "quick"))
        assert isinstance(told(other), MirroredPose)
        gate.set()


def test_a_fault_is_told_and_the_connection_stays(capsys: pytest.CaptureFixture[str]) -> None:
    def serve(message: Any, arrays: Any) -> Any:
        if message.rig == "bad":
            raise ZeroDivisionError("secret")
        return MirroredPose(type="mirrored", id=message.id, arrays={}), {}

    with served(serve=serve) as client, socket(client) as ws:
        told(ws)
        ws.send_bytes(question("mirror", "bad"))
        failed = told(ws)
        assert isinstance(failed, Failed)
        assert "secret" not in failed.reason
        ws.send_bytes(question("mirror", "good"))
        assert isinstance(told(ws), MirroredPose)
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_only_so_many_windows_are_open(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apps, "MOST_CONNECTIONS", 1)
    with socket(client) as ws:
        told(ws)
        with socket(client) as many:
            assert closed(many) == (1013, "1 windows are already open; close some")
        ws.send_bytes(mirror("none"))
        assert isinstance(told(ws), Failed)
    with socket(client) as again:
        told(again)


def test_a_reason_fits_into_a_closing_frame() -> None:
    assert apps._short("é" * 61) == "é" * 61
    for reason in ("é" * 62, "x" * 124, "日" * 200, "x" + "é" * 100):
        short = apps._short(reason)
        assert len(short.encode()) <= 123
        assert short.endswith("…")
        assert reason.startswith(short[:-1])


def test_two_servers_share_nothing() -> None:
    with served(store=RigStore()) as one, served(store=RigStore()) as other:
        rig, arrays = opened(one)
        assert export(other, rig.id, arrays["frames"]).status_code == 409
