"""Processes that generate shards, with recovery from dead workers."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import NamedTuple

from omnisim.core.errors import OmnisimError, PlanError
from omnisim.core.files.atomic_file import remove_partials
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.datasets.generate.shard import ShardMaker

MAX_DEATHS = 3  # of workers per shard, until generation fails
END_S = 5.0  # time for a worker to remove its files
_THREADS = "LP_NUM_THREADS"  # environment variable of Mesa's rasterizer


class SampleJob(NamedTuple):
    """Arguments of all workers."""

    plan: Path  # path of the plan
    folder: Path  # folder of the data set
    device: int | None = None  # EGL index of the GPU; None: the first
    samples: int | None = None  # samples per shard; None: the plan's


class ShardProgress(NamedTuple):
    """Progress of a shard: another sample is rendered, or the whole shard is written."""

    shard: int
    is_whole: bool


def make_shards(job: SampleJob, shards: Sequence[int], workers: int) -> Iterator[ShardProgress]:
    """Generate shards in several processes; yield after each sample and each shard.

    A killed worker loses only its unfinished shard, which another worker generates again.

    Raises:
        OmnisimError: the first fault of a worker.
        PlanError: `MAX_DEATHS` workers died while generating the same shard.
    """
    todo, deaths = deque(shards), Counter[int]()
    running: dict[Connection, _Worker] = {}
    try:
        while todo or any(worker.shard is not None for worker in running.values()):
            for worker in [candidate for candidate in running.values() if candidate.shard is None]:
                worker.take(todo)
            while len(running) < min(workers, len(todo) + len(running)):
                started = _Worker(job)
                running[started.connection] = started
                started.take(todo)
            for ready in wait(list(running)):
                assert isinstance(ready, Connection)
                worker = running[ready]
                try:
                    yield from worker.receive()
                except (EOFError, ConnectionResetError):
                    del running[ready]
                    worker.end()
                    if worker.shard is not None:
                        deaths[worker.shard] += 1
                        if deaths[worker.shard] >= MAX_DEATHS:
                            raise PlanError(
                                f"shard {worker.shard}: {MAX_DEATHS} workers died without an error "
                                "(killed, or out of memory): use fewer --workers"
                            ) from None
                        todo.appendleft(worker.shard)
    finally:
        for worker in running.values():
            worker.end()


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Defer signals that end the process to the end of a `with` block."""
    came: list[int] = []
    before = {}
    if threading.current_thread() is threading.main_thread():  # only there they can be handled
        for number in (signal.SIGINT, signal.SIGTERM):
            before[number] = signal.signal(number, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for late in came:
            signal.raise_signal(late)


class _Worker:
    """Worker process with a connection, and the number of its current shard; None: idle."""

    def __init__(self, job: SampleJob):
        context = multiprocessing.get_context("spawn")  # OpenGL does not survive a fork
        self.connection, child = context.Pipe()
        self.shard: int | None = None
        self._process: BaseProcess = context.Process(target=_work, args=(child, job), daemon=True)
        with uninterrupted():  # a worker whose parent ends meanwhile prints a traceback
            self._process.start()
        child.close()

    def take(self, todo: deque[int]) -> None:
        """Assign the next shard to the worker, if there is one."""
        if not todo:
            return
        self.shard = todo.popleft()
        try:
            self.connection.send(self.shard)
        except OSError:
            return  # it is dead: the end of its messages shows that

    def receive(self) -> Iterator[ShardProgress]:
        """Receive a message.

        Raises:
            OmnisimError: a fault in the worker.
            EOFError, ConnectionResetError: the worker has ended.
        """
        message = self.connection.recv()
        if isinstance(message, OmnisimError):
            raise message
        assert isinstance(message, ShardProgress)
        if message.is_whole:
            self.shard = None
        yield message

    def end(self) -> None:
        """End the process, by force if it does not respond."""
        self.connection.close()
        self._process.terminate()
        self._process.join(END_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def _work(connection: Connection, job: SampleJob) -> None:
    """Generate the shards whose numbers arrive on the connection, until the parent closes it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends this process
    signal.signal(signal.SIGTERM, _end)
    maker: ShardMaker | None = None
    try:
        maker = ShardMaker(PreparedPlan.read(job.plan, job.folder), job.folder, job.device)
        while True:
            shard: int = connection.recv()
            maker.make(shard, lambda: connection.send(ShardProgress(shard, False)), job.samples)  # noqa: B023
            connection.send(ShardProgress(shard, True))
    except OmnisimError as error:
        connection.send(type(error)(str(error)))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass  # the parent has ended
    finally:
        if maker is not None:
            maker.close()


def _end(*_: object) -> None:
    """End the process at once; an exception raised while an object is deleted would be lost."""
    remove_partials()
    os._exit(0)


@contextmanager
def threads_shared(workers: int) -> Iterator[None]:
    """Share the processor's cores among processes, for Mesa's rasterizer.

    Two processes with one thread each render faster than one process with two threads.
    """
    if workers < 2 or _THREADS in os.environ:
        yield
        return
    os.environ[_THREADS] = str(max(1, (os.cpu_count() or 1) // workers))
    try:
        yield
    finally:
        del os.environ[_THREADS]
