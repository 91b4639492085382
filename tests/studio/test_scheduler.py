"""What waits, what is next, and what is dropped: with a fake of the work that waits until it is told to go on."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

import numpy as np
import pytest
from numpy import ndarray
from studio_rigs import envelope

from interpose.errors import InputError
from interpose.studio import messages
from interpose.studio import scheduler as scheduler
from interpose.studio.handlers import Answer
from interpose.studio.protocol import SERVER_MESSAGE, Candidates, ClientMessage, Dropped, Failed, ServerMessage
from interpose.studio.rigs import UnknownRig
from interpose.studio.scheduler import Disconnect, RateLimit, RequestQueue, WorkerPool

PATIENCE = 20.0
"""Seconds after which a test that hangs fails."""


def generate(number: int, gap: str = "g", live: bool = False, **fields: Any) -> bytes:
    header = {
        "type": "generate",
        "id": number,
        "rig": "a",
        "arrays": {},
        "gap": gap,
        "frames": 10,
        "settings": {"method": "dcmoe"},
        "live": live,
        **fields,
    }
    return envelope(header)


def library(number: int) -> bytes:
    return envelope({"type": "library", "id": number, "rig": "a"})


def cancel(gap: str = "g") -> bytes:
    return envelope({"type": "cancel", "gap": gap})


class Work:
    """In place of the work: each piece waits until it is let go, and then answers, or raises what is told."""

    def __init__(self) -> None:
        self.began: asyncio.Queue[int] = asyncio.Queue()
        self.raises: dict[int, BaseException] = {}
        self._gates: dict[int, threading.Event] = {}
        self._loop = asyncio.get_running_loop()

    def __call__(self, message: ClientMessage, arrays: Mapping[str, ndarray]) -> Answer:
        assert message.type != "cancel"
        self._loop.call_soon_threadsafe(self.began.put_nowait, message.id)
        assert self._gate(message.id).wait(PATIENCE)
        if message.id in self.raises:
            raise self.raises[message.id]
        frames = {"frames": np.full((1, 1, 3), message.id, np.float32)}
        gap = getattr(message, "gap", "-")
        told = Candidates(
            type="candidates", id=message.id, gap=gap, live=False, infos=[], seconds=0.0, arrays=messages.shapes(frames)
        )
        return told, frames

    def _gate(self, number: int) -> threading.Event:
        return self._gates.setdefault(number, threading.Event())

    def let(self, *numbers: int) -> None:
        for number in numbers:
            self._gate(number).set()

    async def begins(self) -> int:
        return await self.began.get()


class Window:
    """A queue and what its browser was sent."""

    def __init__(self, shop: WorkerPool) -> None:
        self.inbox: asyncio.Queue[ServerMessage] = asyncio.Queue()
        self.takes = asyncio.Event()
        self.takes.set()
        self.queue = RequestQueue(shop, self._send)
        self.writer = asyncio.create_task(self.queue.write())

    async def _send(self, data: bytes) -> None:
        await self.takes.wait()
        self.inbox.put_nowait(messages.unpack(data, SERVER_MESSAGE)[0])

    def ask(self, *messages: bytes) -> None:
        for message in messages:
            self.queue.take(message)

    async def told(self) -> tuple[str, int]:
        one = await self.inbox.get()
        return one.type, getattr(one, "id", -1)


Scene = Callable[[Work, WorkerPool], Awaitable[None]]


def play(scene: Scene, at_once: int = 2) -> None:
    """Runs a scene to its end; whatever still waits then is let go."""

    async def run() -> None:
        work = Work()
        shop = WorkerPool(work, at_once)
        try:
            await asyncio.wait_for(scene(work, shop), PATIENCE)
        finally:
            work.let(*range(1000))
            shop.stop()
            tasks = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
            for task in tasks:
                if task.get_coro().__name__ == "write":  # type: ignore[union-attr]
                    task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    asyncio.run(run())


async def settled() -> None:
    """All that can happen by itself on the loop has happened."""
    for _ in range(20):
        await asyncio.sleep(0)


def test_a_question_is_answered() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one = Window(shop)
        one.ask(generate(1))
        assert await work.begins() == 1
        work.let(1)
        assert await one.told() == ("candidates", 1)
        assert one.queue.waiting == one.queue.running == []

    play(scene)


def test_a_newer_question_takes_the_place_of_one_that_waits() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one = Window(shop)
        one.ask(generate(1, "a"))
        assert await work.begins() == 1
        one.ask(generate(2, "b"), generate(3, "b"), generate(4, "b"))
        assert [await one.told() for _ in range(2)] == [("dropped", 2), ("dropped", 3)]
        work.let(1, 2, 3, 4)
        assert await one.told() == ("candidates", 1)
        assert await work.begins() == 4
        assert await one.told() == ("candidates", 4)
        assert one.inbox.empty()

    play(scene)


def test_the_late_answer_of_a_dropped_one_is_not_sent() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one = Window(shop)
        one.ask(generate(1))
        assert await work.begins() == 1
        one.ask(generate(2))
        assert await one.told() == ("dropped", 1)
        work.let(1)
        assert await work.begins() == 2
        work.let(2)
        assert await one.told() == ("candidates", 2)
        one.ask(library(3))
        work.let(3)
        assert await one.told() == ("candidates", 3)

    play(scene)


def test_a_dropped_one_is_told_of_once() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one = Window(shop)
        one.ask(generate(1))
        assert await work.begins() == 1
        one.ask(cancel(), cancel(), generate(2))
        assert await one.told() == ("dropped", 1)
        work.let(1, 2)
        assert await one.told() == ("candidates", 2)

    play(scene)


def test_cancel_drops_a_gap_that_waits_and_one_that_runs_and_no_other() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one = Window(shop)
        one.ask(generate(1, "a"))
        assert await work.begins() == 1
        one.ask(generate(2, "b"), generate(3, "c"), cancel("b"))
        assert await one.told() == ("dropped", 2)
        one.ask(cancel("a"))
        assert await one.told() == ("dropped", 1)
        work.let(1, 3)
        assert await work.begins() == 3
        assert await one.told() == ("candidates", 3)

    play(scene)


def test_what_is_told_of_a_dropped_one_is_of_its_gap() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one = Window(shop)
        one.ask(generate(1, "a"), cancel("a"))
        assert await one.inbox.get() == Dropped(type="dropped", id=1, gap="a")

    play(scene)


def test_what_is_dragged_goes_before_all_else_one_at_a_time() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one = Window(shop)
        one.ask(generate(1, "a"))
        assert await work.begins() == 1
        one.ask(generate(2, "b"), generate(3, "c", live=True))
        assert await work.begins() == 3  # beside the full one
        one.ask(generate(4, "d", live=True), generate(5, "e", live=True))
        work.let(1)
        assert await one.told() == ("candidates", 1)
        await settled()
        assert work.began.empty(), "neither a second live one nor what came before it"
        work.let(3)
        assert await one.told() == ("candidates", 3)
        assert await work.begins() == 4
        work.let(4)
        assert await work.begins() == 5
        work.let(5)
        assert await work.begins() == 2
        work.let(2)

    play(scene)


def test_one_that_is_not_live_at_a_time_but_other_questions_beside_it() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one = Window(shop)
        one.ask(generate(1, "a"))
        assert await work.begins() == 1
        one.ask(generate(2, "b"))
        await settled()
        assert work.began.empty()
        one.ask(library(3))
        assert await work.begins() == 3
        work.let(3)
        assert await one.told() == ("candidates", 3)
        assert work.began.empty()
        work.let(1)
        assert await work.begins() == 2

    play(scene)


def test_the_window_with_the_least_running_is_next_and_windows_take_turns() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one, other = Window(shop), Window(shop)
        one.ask(*(library(i) for i in range(1, 5)))
        assert sorted([await work.begins(), await work.begins()]) == [1, 2]
        other.ask(library(11), library(12))
        work.let(1)
        assert await work.begins() == 11
        work.let(2)
        assert await work.begins() in (3, 12)

    play(scene)


def test_the_window_with_less_running_is_next_though_its_turn_is_later() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one, other = Window(shop), Window(shop)
        one.ask(library(1))
        other.ask(library(11))
        assert sorted([await work.begins(), await work.begins()]) == [1, 11]
        one.ask(library(2))
        other.ask(library(12))
        work.let(11)
        assert await work.begins() == 12

    play(scene)


def test_of_windows_with_as_much_running_the_one_that_drags_is_next() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one, other, third = Window(shop), Window(shop), Window(shop)
        third.ask(library(1))
        assert await work.begins() == 1
        one.ask(generate(2))
        other.ask(generate(3, live=True))
        work.let(1)
        assert await work.begins() == 3

    play(scene, at_once=1)


def test_no_more_is_done_for_a_window_that_does_not_read() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one = Window(shop)
        one.takes.clear()
        work.let(*range(1, 6))
        one.ask(*(library(i) for i in range(1, 6)))
        began = [await work.begins(), await work.begins()]
        while one.queue.running:
            await asyncio.sleep(0)
        await settled()
        assert work.began.empty()
        assert sorted(began) == [1, 2]
        other = Window(shop)
        other.ask(library(6))
        work.let(6)
        assert await other.told() == ("candidates", 6)
        work.began.get_nowait()
        one.takes.set()
        assert sorted([(await one.told())[1] for _ in range(5)]) == [1, 2, 3, 4, 5]

    play(scene)


def test_only_so_much_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scheduler, "MOST_WAITING", 3)

    async def scene(work: Work, shop: WorkerPool) -> None:
        one = Window(shop)
        one.ask(generate(1, "a"), generate(2, "b"), generate(3, "c"), generate(4, "d"))
        assert one.inbox.empty()
        one.ask(generate(5, "e"))
        told = await one.inbox.get()
        assert isinstance(told, Failed)
        assert (told.id, told.gap, told.again) == (5, "e", False)
        assert "3 requests are already waiting" in told.reason
        one.ask(generate(6, "d"))  # in place of another
        assert await one.told() == ("dropped", 4)
        assert [job.message.id for job in one.queue.waiting] == [2, 3, 6]  # type: ignore[union-attr]

    play(scene)


@pytest.mark.parametrize(
    ("error", "expected", "again"),
    [
        (InputError("the gap is too short"), "the gap is too short", False),
        (UnknownRig("open its file again"), "open its file again", True),
        (MemoryError(), "not enough memory", False),
        (ZeroDivisionError("secret"), "internal server error", False),
        (RecursionError("secret"), "internal server error", False),
    ],
)
def test_whatever_goes_wrong_is_told_and_the_window_goes_on(
    error: Exception, expected: str, again: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one, other = Window(shop), Window(shop)
        work.raises[1] = error
        work.let(1, 2, 3)
        one.ask(generate(1))
        told = await one.inbox.get()
        assert isinstance(told, Failed)
        assert (told.id, told.gap, told.again) == (1, "g", again)
        assert expected in told.reason
        assert "secret" not in told.reason
        other.ask(library(2))
        assert await other.told() == ("candidates", 2)
        one.ask(generate(3))
        assert await one.told() == ("candidates", 3)

    play(scene)
    assert ("Traceback" in capsys.readouterr().err) == ("internal" in expected)


def test_an_answer_that_does_not_fit_its_header_is_a_fault_that_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    job = scheduler.Job(messages.unpack(generate(1), scheduler.CLIENT_MESSAGE)[0], {}, None)  # type: ignore[arg-type]
    wrong = Candidates(type="candidates", id=1, gap="g", live=False, infos=[], seconds=0.0, arrays={"frames": [3]})
    told, _ = messages.unpack(scheduler._answer(lambda *_: (wrong, {}), job), SERVER_MESSAGE)
    assert isinstance(told, Failed)
    assert "the header describes" in capsys.readouterr().err


def test_what_was_asked_by_a_window_that_is_gone_is_for_nobody() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one, other = Window(shop), Window(shop)
        one.ask(generate(1, "a"), generate(2, "b"))
        assert await work.begins() == 1
        one.queue.close()
        other.ask(library(3))
        work.let(1, 2, 3)
        assert await work.begins() == 3
        assert await other.told() == ("candidates", 3)
        while one.queue.running:  # its thread may end after the other one's
            await asyncio.sleep(0.001)
        assert one.queue.waiting == []
        assert one.inbox.empty()

    play(scene)


def refused(window: Window, message: bytes) -> Disconnect:
    with pytest.raises(Disconnect) as caught:
        window.ask(message)
    return caught.value


def test_what_is_no_message_is_refused_with_a_code() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one = Window(shop)
        assert refused(one, b"").code == 1007
        assert "type is missing" in refused(one, envelope({})).reason
        long = refused(one, b"\0" * (scheduler.LARGEST_MESSAGE + 1))
        assert long.code == 1009
        assert "the message has 4194305 bytes; the limit is 4194304" in long.reason
        assert "the limit is 524288" in refused(one, envelope(" " * (scheduler.LARGEST_MESSAGE_HEADER + 4))).reason
        assert work.began.empty()

    play(scene)


def test_answers_that_are_not_read_do_not_pile_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scheduler, "MOST_UNREAD", 5)

    async def scene(work: Work, shop: WorkerPool) -> None:
        one = Window(shop)
        one.takes.clear()
        for number in range(1, 8):
            one.ask(generate(number))
        assert refused(one, generate(9)).code == 1008

    play(scene)


def test_a_window_that_asks_too_often_is_refused() -> None:
    async def scene(work: Work, shop: WorkerPool) -> None:
        one = Window(shop)
        one.queue._limit = RateLimit(clock=lambda: 0.0)
        one.ask(*[cancel()] * 4 * scheduler.MOST_MESSAGES)
        many = refused(one, cancel())
        assert (many.code, many.reason) == (1008, "too many messages; send at most 60 per second")
        Window(shop).ask(cancel())  # another is not

    play(scene)


def test_so_many_messages_at_once_and_so_many_a_second() -> None:
    now = 100.0
    limit = RateLimit(8.0, lambda: now)
    assert [limit.take() for _ in range(33)] == [True] * 32 + [False]
    now += 0.0625
    assert not limit.take()
    now += 0.0625
    assert limit.take()
    assert not limit.take()
    now += 2.0
    assert [limit.take() for _ in range(17)] == [True] * 16 + [False]
    now += 1e6
    assert [limit.take() for _ in range(33)] == [True] * 32 + [False]
