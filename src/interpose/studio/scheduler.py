"""The work of all connections: what waits, what is next, and what is dropped because something newer came.

A :class:`Desk` belongs to one connection and a :class:`Workshop` to the process. They live on the event loop; only the
work itself runs in threads. Of one connection a `generate` that is live goes first, one at a time, for two in Python
take twice as long each; then everything else in turn, but only one `generate` that is not live at a time, so that there
is room for what must be quick. Of several connections the one with the least running goes first.
"""

from __future__ import annotations

import asyncio
import sys
import time
import traceback
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from numpy import ndarray

from interpose.errors import InputError
from interpose.studio import messages
from interpose.studio.handlers import Answer
from interpose.studio.protocol import (
    ASKED,
    LARGEST_MESSAGE,
    MOST_MESSAGES,
    Asked,
    Cancel,
    Dropped,
    Failed,
    Generate,
)
from interpose.studio.rigs import Unknown

Serve = Callable[[Asked, Mapping[str, ndarray]], Answer]

AT_ONCE = 2
"""Pieces of work in the process."""
MOST_WAITING = 256
"""Pieces of work of one connection that wait."""
MOST_UNSENT = 2
"""Answers of one connection that the browser has not taken yet; with more, none of its work is begun."""
MOST_LEFT = 4096
"""Messages that a browser leaves lying before its connection is closed."""
LARGEST_HEADER = 512 * 1024
MALFORMED, UNWELCOME, TOO_LARGE = 1007, 1008, 1009
"""Codes that a connection is closed with (RFC 6455, section 7.4.1)."""


class Refused(Exception):
    """The connection is to be closed with this code, for this reason."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason


@dataclass(eq=False)
class Job:
    """A question that is not answered yet. dropped: its answer is not wanted any more."""

    asked: Asked
    arrays: Mapping[str, ndarray]
    desk: Desk
    dropped: bool = False

    @property
    def live(self) -> bool:
        return isinstance(self.asked, Generate) and self.asked.live

    @property
    def full(self) -> bool:
        return isinstance(self.asked, Generate) and not self.asked.live


class Workshop:
    """Does the work of all desks, :data:`AT_ONCE` pieces at once, in threads of its own."""

    def __init__(self, serve: Serve, at_once: int = AT_ONCE) -> None:
        self._serve = serve
        self._at_once = at_once
        self._pool = ThreadPoolExecutor(at_once, thread_name_prefix="studio")
        self._desks: list[Desk] = []
        self._running = 0
        self._tasks: set[asyncio.Task[None]] = set()

    def open(self, desk: Desk) -> None:
        self._desks.append(desk)

    def close(self, desk: Desk) -> None:
        self._desks.remove(desk)

    def stop(self) -> None:
        """No further work is begun."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def begin(self) -> None:
        """Begins whatever there is room for."""
        while self._running < self._at_once:
            ready = [(desk, job) for desk in self._desks if (job := desk.next()) is not None]
            if not ready:
                return
            desk, job = min(ready, key=lambda one: (len(one[0].running), not one[1].live))
            self._desks.remove(desk)
            self._desks.append(desk)  # the others' turn comes first
            desk.waiting.remove(job)
            desk.running.append(job)
            self._running += 1
            task = asyncio.get_running_loop().create_task(self._do(job))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _do(self, job: Job) -> None:
        try:
            made = await asyncio.get_running_loop().run_in_executor(self._pool, _made, self._serve, job)
        finally:
            self._running -= 1
            job.desk.running.remove(job)
        job.desk.finished(job, made)
        self.begin()


class Desk:
    """What one connection has asked for and has not got yet."""

    def __init__(self, workshop: Workshop, send: Callable[[bytes], Awaitable[None]]) -> None:
        self.waiting: list[Job] = []
        self.running: list[Job] = []
        self._workshop = workshop
        self._send = send
        self._outgoing: asyncio.Queue[tuple[bytes, bool]] = asyncio.Queue()
        self._unsent = 0
        self._open = True
        self._bucket = Bucket()
        workshop.open(self)

    def take(self, data: bytes) -> None:
        """A message came. Raises :class:`Refused` where the connection is to be closed for it."""
        if not self._bucket.take():
            raise Refused(UNWELCOME, f"too many messages: {MOST_MESSAGES} a second are served; send fewer")
        if self._outgoing.qsize() > MOST_LEFT:
            raise Refused(UNWELCOME, "too many answers lie unread; read them, or ask less")
        if len(data) > LARGEST_MESSAGE:
            raise Refused(TOO_LARGE, f"a message of {len(data)} bytes came; {LARGEST_MESSAGE} are the most")
        try:
            asked, arrays = messages.unpack(data, ASKED, LARGEST_HEADER)
        except InputError as error:
            raise Refused(MALFORMED, str(error)) from None
        if isinstance(asked, Generate | Cancel):
            self._drop(asked.gap)
        if not isinstance(asked, Cancel):
            if len(self.waiting) >= MOST_WAITING:
                self._say(_failed(asked, f"{MOST_WAITING} questions wait for an answer already; ask again later"))
                return
            self.waiting.append(Job(asked, arrays, self))
        self._workshop.begin()

    def next(self) -> Job | None:
        """What is to be done next; None where nothing waits, or the browser has not taken what was done."""
        if self._unsent + len(self.running) >= MOST_UNSENT:
            return None
        live = [job for job in self.waiting if job.live]
        if live:
            return None if any(job.live for job in self.running) else live[0]
        busy = any(job.full for job in self.running)
        return next((job for job in self.waiting if not (busy and job.full)), None)

    def finished(self, job: Job, made: bytes) -> None:
        """A piece of work is done; a dropped one was told of before."""
        if self._open and not job.dropped:
            self._unsent += 1
            self._outgoing.put_nowait((made, True))

    async def write(self) -> None:
        """Sends what is to be said, one message after the other, until it is cancelled."""
        while True:
            data, answer = await self._outgoing.get()
            await self._send(data)
            if answer:
                self._unsent -= 1
                self._workshop.begin()

    def close(self) -> None:
        """The connection is gone: nothing waits any more, and what runs is for nobody."""
        self._open = False
        self.waiting.clear()
        self._workshop.close(self)

    def _drop(self, gap: str) -> None:
        """Tells that what was asked of a gap before is not answered."""
        old = [job for job in (*self.waiting, *self.running) if isinstance(job.asked, Generate)]
        for job in old:
            if job.asked.gap == gap and not job.dropped:  # type: ignore[union-attr]
                job.dropped = True
                self._say(messages.pack(Dropped(type="dropped", id=job.asked.id, gap=gap), {}))  # type: ignore[union-attr]
        self.waiting = [job for job in self.waiting if not job.dropped]

    def _say(self, data: bytes) -> None:
        self._outgoing.put_nowait((data, False))


class Bucket:
    """How many messages may come: :data:`MOST_MESSAGES` a second for long, four times as many at once."""

    def __init__(self, rate: float = MOST_MESSAGES, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate = rate
        self._clock = clock
        self._left = 4.0 * rate
        self._then = clock()

    def take(self) -> bool:
        """Whether there is one left."""
        now = self._clock()
        self._left = min(4.0 * self._rate, self._left + (now - self._then) * self._rate)
        self._then = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


def _made(serve: Serve, job: Job) -> bytes:
    """The answer to a job, whatever happens; runs in a thread."""
    if job.dropped:
        return b""
    try:
        return messages.pack(*serve(job.asked, job.arrays))
    except Unknown as error:
        return _failed(job.asked, str(error), again=True)
    except InputError as error:
        return _failed(job.asked, str(error))
    except MemoryError:
        return _failed(job.asked, "there is not enough memory for this; ask for fewer candidates or a shorter gap")
    except Exception:
        traceback.print_exc(file=sys.stderr)
        return _failed(job.asked, "this went wrong in the server, by a fault of its own; the terminal says more")


def _failed(asked: Asked, reason: str, again: bool = False) -> bytes:
    number = 0 if isinstance(asked, Cancel) else asked.id
    gap = asked.gap if isinstance(asked, Generate) else None
    return messages.pack(Failed(type="failed", id=number, gap=gap, reason=reason, again=again), {})
