"""Schedules the requests of all connections: which waits, which runs next, and which is dropped for a newer one.

A :class:`RequestQueue` belongs to a connection, the :class:`WorkerPool` to the process. Both live on the event loop;
only the jobs run in threads. Within a connection, a live `generate` goes first, one at a time, because two in Python
would each take twice as long. Everything else follows in order, with at most one full `generate` at a time, to leave
room for quick requests. Between connections, the one with the fewest running jobs goes first.
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
    CLIENT_MESSAGE,
    LARGEST_MESSAGE,
    MOST_MESSAGES,
    Cancel,
    ClientMessage,
    Dropped,
    Failed,
    Generate,
)
from interpose.studio.rigs import UnknownRig

Serve = Callable[[ClientMessage, Mapping[str, ndarray]], Answer]

WORKER_THREADS = 2
"""Jobs that run at once in the process."""
MOST_WAITING = 256
"""Waiting jobs per connection."""
MOST_UNSENT = 2
"""Unsent answers per connection from which on none of its jobs is started."""
MOST_UNREAD = 4096
"""Unread messages from which on a connection is closed."""
LARGEST_MESSAGE_HEADER = 512 * 1024
MALFORMED, UNWELCOME, TOO_LARGE = 1007, 1008, 1009
"""Codes for closing a connection (RFC 6455, section 7.4.1)."""


INTERNAL_ERROR = "internal server error; see the terminal for details"


class Disconnect(Exception):
    """The connection has to be closed with this code, for this reason."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason


@dataclass(eq=False)
class Job:
    """An unanswered request. dropped: a newer request has replaced it."""

    message: ClientMessage
    arrays: Mapping[str, ndarray]
    queue: RequestQueue
    dropped: bool = False

    @property
    def live(self) -> bool:
        return isinstance(self.message, Generate) and self.message.live

    @property
    def full(self) -> bool:
        return isinstance(self.message, Generate) and not self.message.live


class WorkerPool:
    """Runs the jobs of all queues, :data:`WORKER_THREADS` at once, in its own threads."""

    def __init__(self, serve: Serve, at_once: int = WORKER_THREADS) -> None:
        self._serve = serve
        self._at_once = at_once
        self._threads = ThreadPoolExecutor(at_once, thread_name_prefix="studio")
        self._queues: list[RequestQueue] = []
        self._running = 0
        self._tasks: set[asyncio.Task[None]] = set()

    def open(self, queue: RequestQueue) -> None:
        self._queues.append(queue)

    def close(self, queue: RequestQueue) -> None:
        self._queues.remove(queue)

    def stop(self) -> None:
        """Starts no further jobs."""
        self._threads.shutdown(wait=False, cancel_futures=True)

    def start(self) -> None:
        """Starts as many jobs as there is room for."""
        while self._running < self._at_once:
            ready = [(queue, job) for queue in self._queues if (job := queue.next()) is not None]
            if not ready:
                return
            queue, job = min(ready, key=lambda one: (len(one[0].running), not one[1].live))
            self._queues.remove(queue)
            self._queues.append(queue)  # it goes last next time
            queue.waiting.remove(job)
            queue.running.append(job)
            self._running += 1
            task = asyncio.get_running_loop().create_task(self._run(job))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _run(self, job: Job) -> None:
        try:
            answer = await asyncio.get_running_loop().run_in_executor(self._threads, _answer, self._serve, job)
        finally:
            self._running -= 1
            job.queue.running.remove(job)
        job.queue.finished(job, answer)
        self.start()


class RequestQueue:
    """The unanswered requests of one connection."""

    def __init__(self, pool: WorkerPool, send: Callable[[bytes], Awaitable[None]]) -> None:
        self.waiting: list[Job] = []
        self.running: list[Job] = []
        self._pool = pool
        self._send = send
        self._outgoing: asyncio.Queue[tuple[bytes, bool]] = asyncio.Queue()
        self._unsent = 0
        self._open = True
        self._limit = RateLimit()
        pool.open(self)

    def take(self, data: bytes) -> None:
        """Queues the request in a message. Raises :class:`Disconnect` if the connection has to be closed."""
        if not self._limit.take():
            raise Disconnect(UNWELCOME, f"too many messages; send at most {MOST_MESSAGES} per second")
        if self._outgoing.qsize() > MOST_UNREAD:
            raise Disconnect(UNWELCOME, "too many unread answers; read them, or send fewer requests")
        if len(data) > LARGEST_MESSAGE:
            raise Disconnect(TOO_LARGE, f"the message has {len(data)} bytes; the limit is {LARGEST_MESSAGE}")
        try:
            message, arrays = messages.unpack(data, CLIENT_MESSAGE, LARGEST_MESSAGE_HEADER)
        except InputError as error:
            raise Disconnect(MALFORMED, str(error)) from None
        if isinstance(message, Generate | Cancel):
            self._drop(message.gap)
        if not isinstance(message, Cancel):
            if len(self.waiting) >= MOST_WAITING:
                self._reply(_failed(message, f"{MOST_WAITING} requests are already waiting; try again later"))
                return
            self.waiting.append(Job(message, arrays, self))
        self._pool.start()

    def next(self) -> Job | None:
        """The next job; None if nothing waits, or if the browser has not read its earlier answers."""
        if self._unsent + len(self.running) >= MOST_UNSENT:
            return None
        live = [job for job in self.waiting if job.live]
        if live:
            return None if any(job.live for job in self.running) else live[0]
        busy = any(job.full for job in self.running)
        return next((job for job in self.waiting if not (busy and job.full)), None)

    def finished(self, job: Job, answer: bytes) -> None:
        """Queues a finished job's answer. A dropped job has been answered already."""
        if self._open and not job.dropped:
            self._unsent += 1
            self._outgoing.put_nowait((answer, True))

    async def write(self) -> None:
        """Sends outgoing messages in order, until it is cancelled."""
        while True:
            data, answer = await self._outgoing.get()
            await self._send(data)
            if answer:
                self._unsent -= 1
                self._pool.start()

    def close(self) -> None:
        """The connection is gone: discards waiting jobs and the answers of running ones."""
        self._open = False
        self.waiting.clear()
        self._pool.close(self)

    def _drop(self, gap: str) -> None:
        """Answers the earlier requests for a gap's candidates with `dropped`."""
        for job in (*self.waiting, *self.running):
            if isinstance(job.message, Generate) and job.message.gap == gap and not job.dropped:
                job.dropped = True
                self._reply(messages.pack(Dropped(type="dropped", id=job.message.id, gap=gap), {}))
        self.waiting = [job for job in self.waiting if not job.dropped]

    def _reply(self, data: bytes) -> None:
        self._outgoing.put_nowait((data, False))


class RateLimit:
    """A token bucket: :data:`MOST_MESSAGES` messages per second, four times as many in a burst."""

    def __init__(self, rate: float = MOST_MESSAGES, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate = rate
        self._clock = clock
        self._left = 4.0 * rate
        self._then = clock()

    def take(self) -> bool:
        """Whether another message is allowed."""
        now = self._clock()
        self._left = min(4.0 * self._rate, self._left + (now - self._then) * self._rate)
        self._then = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


def _answer(serve: Serve, job: Job) -> bytes:
    """The answer to a job, whatever happens. Runs in a thread."""
    if job.dropped:
        return b""
    try:
        return messages.pack(*serve(job.message, job.arrays))
    except UnknownRig as error:
        return _failed(job.message, str(error), again=True)
    except InputError as error:
        return _failed(job.message, str(error))
    except MemoryError:
        return _failed(job.message, "not enough memory; reduce the number of candidates or shorten the gap")
    except Exception:
        traceback.print_exc(file=sys.stderr)
        return _failed(job.message, INTERNAL_ERROR)


def _failed(message: ClientMessage, reason: str, again: bool = False) -> bytes:
    number = 0 if isinstance(message, Cancel) else message.id
    gap = message.gap if isinstance(message, Generate) else None
    return messages.pack(Failed(type="failed", id=number, gap=gap, reason=reason, again=again), {})
