"""Plan of the check: its steps in order, run one after the other within a time limit.

1. Facts about the driver, and buffers that processor and shaders take turns with.
2. Sequences of images, which stalled an NVIDIA H100; each image is drawn twice.
3. The drivers' cases, for `python -m tests.drivers compare` with those of another driver.
4. A drive twice, batches beside single images, images and scans in turn.
5. Speed, and the paper's Fig. 10.
6. The same buffers and sequences with mutable buffers, as before: these may stall the card.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.bounds import Limits, goal_text
from tests.drivers.cases import all_cases
from tests.drivers.gpu import SECONDS
from tests.drivers.gpu.steps import NO_RESULT
from tests.drivers.gpu.variants import CHANGES, HINTS, IMMUTABLE
from tests.drivers.sample import sample_cases

CHECKOUT = Path(__file__).resolve().parents[3]
SCENES = ("soccer", "mapping", "rings")
MIN_STEP_S = 4.0  # no step begins with less time left
# Shares of all time after which cases, and then all but the risky steps, have to be done.
CASES_END, SAFE_END = 0.4, 0.85
HEALTH_S = 20.0
DRIVER_ERRORS = ("Xid", "NVRM", "amdgpu", "i915", "nouveau")  # in lines of the kernel's log
GOALS = {"image, 84² fast": 2000, "batch of 1024 × 84²": 10_000}  # per second, on a card
PrintLine = Callable[[str], None]


@dataclass(frozen=True)
class PlannedStep:
    """Step of the check: its name, the step of `steps` and its arguments, and a time limit."""

    name: str
    work: tuple[str, ...]
    limit_s: float = 40.0
    may_fail: bool = False  # it repeats what is known to stall a card: a failure is a result


def planned_steps() -> list[PlannedStep]:
    """All steps, the risky ones last."""
    cases = {**all_cases(8, 1), **sample_cases(8, 1)}
    return [
        PlannedStep("facts", ("facts",), 30.0),
        PlannedStep("buffers", ("buffers", IMMUTABLE), 30.0),
        *(PlannedStep(f"sequence {name}", ("sequence", name, IMMUTABLE)) for name in SCENES),
        *(PlannedStep(f"case {name}", ("case", name)) for name in cases),
        PlannedStep("drive twice", ("drive",), 60.0),
        PlannedStep("batches", ("batches",), 60.0),
        PlannedStep("in turn", ("in turn",), 90.0),
        *(PlannedStep(f"speed {quality}", ("speed", quality)) for quality in ("fast", "default")),
        PlannedStep("scans and batches", ("scans and batches",), 90.0),
        *(PlannedStep(f"fig 10 {name}", ("fig 10", name), 80.0) for name in SCENES[:2]),
        *(
            PlannedStep(f"variant {variant}", ("sequence", SCENES[0], variant), 25.0, may_fail=True)
            for variant in CHANGES
            if variant != IMMUTABLE
        ),
        *(
            PlannedStep(f"variant buffers {kind}", ("buffers", kind), 25.0, may_fail=True)
            for kind in HINTS
        ),
    ]


def chosen_steps(only: Sequence[str]) -> list[PlannedStep]:
    """Steps whose name begins with one of some words; all without any.

    Raises:
        ValueError: no step's name begins so.
    """
    steps = planned_steps()
    for words in only:
        if not any(step.name.startswith(words) for step in steps):
            names = ", ".join(step.name for step in steps)
            raise ValueError(f"--only: no step begins with {words!r}: expected some of {names}")
    return [step for step in steps if not only or step.name.startswith(tuple(only))]


@dataclass
class Outcome:
    """Outcome of a step: "ok", "FAILED" or "TIMED OUT", in lower case if it may fail.

    For lack of time it is "cut short" or "skipped".
    """

    name: str
    verdict: str
    text: str  # result in words
    seconds: float = 0.0  # wall-clock time, the health check included
    processor_s: float = 0.0  # of all its processes
    waits: int = 0  # frames that took longer than 100 ms
    rows: list[dict[str, Any]] = field(default_factory=list)  # measured speeds
    health: str = ""  # complaint of the health check; empty: healthy
    kernel: list[str] = field(default_factory=list)  # new lines of the kernel's log


def check_gpu(
    out: Path,
    seconds: float = SECONDS,
    only: Sequence[str] = (),
    scale: float = 1.0,
    print_line: PrintLine = print,
) -> bool:
    """Run the steps, and put everything into a tar file; it grows with each step.

    Args:
        out: the tar file.
        seconds: time limit of the whole.
        only: beginnings of the names of steps; none: all.
        scale: share of the images.
        print_line: called with each line of the report.

    Returns:
        True if no step failed, other than those that may.

    Raises:
        ValueError: no step has such a name.
    """
    steps = chosen_steps(only)
    outcomes: list[Outcome] = []
    with tempfile.TemporaryDirectory(prefix="omnisim-gpu-") as folder:
        out.parent.mkdir(parents=True, exist_ok=True)
        tarfile.open(out, "w").close()
        try:
            for outcome in _outcomes(steps, Path(folder), out, seconds, scale):
                outcomes.append(outcome)
                print_line(_line(outcome))
        finally:
            summary = summary_lines(outcomes)
            _put(out, "summary.txt", "\n".join(summary) + "\n")
            _put(out, "summary.json", json.dumps([vars(one) for one in outcomes], indent=1))
    print_line("")
    for line in summary:
        print_line(line)
    print_line(f"{out}: {out.stat().st_size / 1e6:.1f} MB")
    return not any(outcome.verdict in ("FAILED", "TIMED OUT") for outcome in outcomes)


def summary_lines(outcomes: Sequence[Outcome]) -> list[str]:
    """Table of the outcomes."""
    rows = [
        ("step", "", "s", "waits", "health", ""),
        *(
            (
                outcome.name, outcome.verdict, f"{outcome.seconds:.1f}", str(outcome.waits),
                "" if outcome.verdict == "skipped"
                else "ill" if outcome.health or outcome.kernel else "well",
                outcome.text,
            )
            for outcome in outcomes
        ),
    ]  # fmt: skip
    notes = [f"{outcome.name}: {outcome.health}" for outcome in outcomes if outcome.health]
    notes += [f"{outcome.name}: kernel: {line}" for outcome in outcomes for line in outcome.kernel]
    total_s, processor_s = (
        sum(getattr(outcome, name) for outcome in outcomes) for name in ("seconds", "processor_s")
    )
    waits = sum(outcome.waits for outcome in outcomes)
    return [
        *_table(rows), *notes, *_speed_lines([row for outcome in outcomes for row in outcome.rows]),
        f"{total_s:.0f} s, {processor_s:.0f} s of the processor; {waits} frames over 100 ms",
    ]  # fmt: skip


def _speed_lines(measured: Sequence[dict[str, Any]]) -> list[str]:
    """Table of the measured speeds, with their goals."""
    if not measured:
        return []
    rows = [("speed", "per second", "median ms", "p99 ms", "max ms", "waits", "goal")]
    for row in measured:
        goal = GOALS.get(row["what"])
        entry = Limits(goal=goal, at_least=True).judge(row["what"], row["per_second"])
        times = (f"{row[f'{name}_ms']:.2f}" for name in ("median", "p99", "max"))
        rows.append(
            (
                row["what"], f"{row['per_second']:.4g}", *times, str(row["waits"]),
                "" if goal is None else f"≥ {goal}: {goal_text(entry)}",
            )
        )  # fmt: skip
    return ["", *_table(rows), ""]


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def _line(outcome: Outcome) -> str:
    line = f"{outcome.seconds:6.1f} s  {outcome.verdict:9}  {outcome.name}: {outcome.text}"
    return line + "".join(f"\n    {note}" for note in (outcome.health, *outcome.kernel) if note)


def _outcomes(
    steps: Sequence[PlannedStep], folder: Path, out: Path, seconds: float, scale: float
) -> Iterator[Outcome]:
    """Run one step after the other, and keep the files of each."""
    log = _KernelLog()
    begin_s = time.monotonic()
    for number, step in enumerate(steps):
        is_case = step.work[0] == "case"
        end = CASES_END if is_case else 1.0 if step.may_fail else SAFE_END
        left_s = begin_s + end * seconds - time.monotonic()
        if left_s < MIN_STEP_S:
            yield Outcome(step.name, "skipped", "no time left")
            continue
        own = folder / f"{number:02}-{step.name.replace(' ', '-')}"
        own.mkdir()
        outcome = _run(step, own, min(step.limit_s, left_s), scale)
        outcome.kernel = log.new_lines()
        with tarfile.open(out, "a") as tar:
            for path in sorted(own.rglob("*")):
                place = f"cases/{path.name}" if path.suffix == ".npz" else path.relative_to(folder)
                tar.add(path, str(place), recursive=False)
        yield outcome


def _run(step: PlannedStep, folder: Path, limit_s: float, scale: float) -> Outcome:
    """Run a step and then the health check, each in a process of its own."""
    start_s, processor_s = time.monotonic(), _processor_s()
    module = ("tests.drivers.gpu.steps", str(folder), str(scale), *step.work)
    status = _process(module, folder / "output.txt", limit_s)
    result: dict[str, Any] = {"ok": False, "text": NO_RESULT, "waits": 0, "rows": []}
    if (folder / "result.json").is_file():
        result |= json.loads((folder / "result.json").read_text("utf-8"))
    verdict, text = "ok", result["text"]
    if status is None:
        verdict = "TIMED OUT" if limit_s >= step.limit_s else "cut short"
        text = f"not finished after {limit_s:.0f} s; {text}"
    elif status or not result["ok"]:
        verdict = "FAILED"
        if text == NO_RESULT:
            text = f"exit status {status}: {_last_line(folder / 'output.txt')}"
    health = ""
    if (end := _process(("tests.drivers.gpu.health",), folder / "health.txt", HEALTH_S)) != 0:
        health = "no answer" if end is None else _last_line(folder / "health.txt")
    verdict = verdict.lower() if step.may_fail else verdict
    seconds, processor_s = time.monotonic() - start_s, _processor_s() - processor_s
    return Outcome(
        step.name, verdict, text, seconds, processor_s, result["waits"], result["rows"], health
    )


def _last_line(path: Path) -> str:
    lines = path.read_text("utf-8", "replace").strip().splitlines()
    return lines[-1] if lines else "no output"


def _process(module: Sequence[str], output: Path, limit_s: float) -> int | None:
    """Exit status of a module in a new process; None: it was killed, or left alone, at the limit.

    A driver that waits in the kernel cannot be killed: such a process is not waited for.
    """
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
    with output.open("w") as file:
        process = subprocess.Popen(
            [sys.executable, "-m", *module], cwd=CHECKOUT, env=environment,
            stdout=file, stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip
    try:
        return process.wait(limit_s)
    except subprocess.TimeoutExpired:
        return None
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(3.0)


class _KernelLog:
    """Lines of the kernel's log about graphics drivers; empty where it may not be read."""

    def __init__(self) -> None:
        self._known = set(self._lines())

    def new_lines(self) -> list[str]:
        """Lines since the last call."""
        new = [line for line in self._lines() if line not in self._known]
        self._known.update(new)
        return new

    @staticmethod
    def _lines() -> list[str]:
        try:
            done = subprocess.run(
                ["dmesg"], capture_output=True, text=True, errors="replace", check=False,
                timeout=5.0,
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired):
            return []
        return [line for line in done.stdout.splitlines() if any(e in line for e in DRIVER_ERRORS)]


def _processor_s() -> float:
    """Processor time of all processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _put(out: Path, name: str, text: str) -> None:
    """Add a text file to the tar file."""
    with tempfile.NamedTemporaryFile("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        with tarfile.open(out, "a") as tar:
            tar.add(file.name, name)
