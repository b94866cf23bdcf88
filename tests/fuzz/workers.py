"""Processes that read damaged samples: one that ends, hangs or takes all memory is a finding."""

import multiprocessing
import os
import resource
import signal
import tempfile
from collections import Counter, deque
from collections.abc import Iterator
from multiprocessing.connection import Connection, wait
from pathlib import Path

from tests.fuzz.cases import Case, Finding, Samples

BATCH = 100  # cases that a process takes at once
LIMIT_CPU_S = 10.0  # of one case; a sample takes milliseconds
LIMIT_S = 300.0  # of a batch without a word, on a machine that is busy with other work
LIMIT_BYTES = 4 << 30  # of a process's addresses beyond those it has at its start
_SPAWN = multiprocessing.get_context("spawn")


class _Worker:
    """Process with samples of its own.

    Attributes:
        connection: takes batches; gives findings, and None at a batch's end.
        batch: inputs that it reads now.
    """

    def __init__(self, samples: Samples, folder: Path):
        self.connection, theirs = _SPAWN.Pipe()
        self.batch: list[Case] = []
        self._position = _SPAWN.Value("i", 0, lock=False)
        arguments = (samples.folder, tuple(samples._files), folder, theirs, self._position)
        self._process = _SPAWN.Process(target=_work, args=arguments, daemon=True)
        self._process.start()
        theirs.close()

    def give(self, batch: list[Case]) -> None:
        """Hand over cases."""
        self.batch = batch
        self._position.value = 0
        self.connection.send(batch)

    def died(self) -> tuple[Finding, list[Case]]:
        """Finding of a process that has ended, or is ended for its silence, and the cases left."""
        self._process.join(0.5)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
            kind = f"hangs: silent for {LIMIT_S:g} s"
        elif self._process.exitcode == -signal.SIGPROF:
            kind = f"hangs: more than {LIMIT_CPU_S:g} s"
        else:
            kind = f"ends the process: exit status {self._process.exitcode}"
        position = self._position.value
        return Finding(self.batch[position], kind, ""), self.batch[position + 1 :]

    def close(self) -> None:
        """End the process."""
        self._process.terminate()
        self._process.join()


def _work(
    shared: Path, names: tuple[str, ...], folder: Path, connection: Connection, position
) -> None:
    samples = Samples(shared, names).copy(folder)
    with open("/proc/self/statm") as statm:
        size = int(statm.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + LIMIT_BYTES, size + LIMIT_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    noise = tempfile.TemporaryFile()  # noqa: SIM115  # as long as the process
    os.dup2(noise.fileno(), 1)
    os.dup2(noise.fileno(), 2)
    while True:
        for index, case in enumerate(connection.recv()):
            position.value = index
            signal.setitimer(signal.ITIMER_PROF, LIMIT_CPU_S)  # its end is the process's
            finding = samples.check(case)
            if written := noise.tell():
                noise.seek(0)
                text = noise.read(written).decode(errors="replace")
                noise.truncate(0)
                noise.seek(0)
                finding = finding or Finding(case, "prints to the console", text[:500])
            if finding:
                connection.send(finding)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        connection.send(None)


def run_cases(
    samples: Samples, cases: Iterator[Case], jobs: int, folder: Path
) -> Iterator[Finding | Counter]:
    """Read all cases; yields findings, and how many of each reader a finished batch had.

    Args:
        samples: valid ones.
        cases: in order.
        jobs: processes at a time.
        folder: an empty one for the processes' own.
    """
    retry: deque[list[Case]] = deque()
    started, workers = 0, {}

    def start() -> None:
        nonlocal started
        batch = retry.popleft() if retry else [case for _, case in zip(range(BATCH), cases)]  # noqa: B905
        if batch:
            worker = _Worker(samples, folder / f"worker-{started}")
            started += 1
            worker.give(batch)
            workers[worker.connection] = worker

    for _ in range(jobs):
        start()
    try:
        while workers:
            for connection in wait(list(workers), LIMIT_S) or list(workers):
                worker = workers[connection]
                try:
                    if not connection.poll():
                        raise EOFError  # silent for too long
                    finding = connection.recv()
                except (EOFError, ConnectionResetError):
                    del workers[connection]
                    finding, left = worker.died()
                    yield Counter(case.reader for case in worker.batch[: -len(left) or None])
                    retry.extend([left] if left else [])
                    start()
                if finding is not None:
                    yield finding
                    continue
                yield Counter(case.reader for case in worker.batch)
                batch = retry.popleft() if retry else [c for _, c in zip(range(BATCH), cases)]  # noqa: B905
                if batch:
                    worker.give(batch)
                else:
                    del workers[connection]
                    worker.close()
    finally:
        for worker in workers.values():
            worker.close()
