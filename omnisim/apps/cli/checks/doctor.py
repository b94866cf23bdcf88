"""`omnisim doctor`."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import sys
import tempfile
import time
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import NamedTuple

from rich.markup import escape

from omnisim.apps import doctor
from omnisim.apps.cli.checks.requests import DoctorRequest
from omnisim.apps.cli.console import out, wrapped
from omnisim.apps.cli.info import PACKAGE, installation
from omnisim.apps.doctor import FAILED, LIMIT_S, OK, OTHER_DRIVER, STEPS, WARNING, Finding
from omnisim.core.files.atomic_file import check_target, write_text
from omnisim.evaluation.child_process import ChildProcesses
from omnisim.rendering.opengl.gl.diagnosis import VARIABLES, override_fault, printed_fault
from omnisim.report.machine import is_software

NEEDED = ("libraries", "OpenGL")  # by all steps after them
_COLORS = {OK: "green", WARNING: "yellow", FAILED: "bold red"}


class DoctorStep(NamedTuple):
    """Finished step: its result, and what its process printed."""

    name: str
    seconds: float
    result: Finding
    output: str = ""


def run(request: DoctorRequest) -> bool:
    """Run all steps, print them and a verdict, write the report; return whether none failed."""
    if request.report is not None:
        check_target(request.report)
    steps: list[DoctorStep] = []
    for name in STEPS:
        known = {line for step in steps for line in step.output.splitlines()}
        steps.append(run_step(name, request.device, known))
        status, text, remedy, _ = steps[-1].result
        head = f"{status:9}{name:13}{steps[-1].seconds:5.1f} s  "
        line = wrapped(text + (f": {remedy}" if remedy else ""), head)[len(status) :]
        out.print(f"[{_COLORS[status]}]{status}[/]{escape(line)}", markup=True)
        if name in NEEDED and steps[-1].result.status == FAILED:
            break
    lines = verdict(steps)
    out.print("\n" + "\n".join(map(wrapped, lines)))
    if request.report is not None:
        write_text(request.report, report(steps, lines))
        out.print(f"{request.report}: the report, for a bug report")
    return all(step.result.status != FAILED for step in steps)


def run_step(
    name: str,
    device: int | None = None,
    known: Collection[str] = (),
    module: str = doctor.__name__,
    limit_s: float = LIMIT_S,
) -> DoctorStep:
    """Run a step in a process of its own.

    Args:
        name: key of `STEPS`.
        device: number of the GPU; None: the first.
        known: lines that drivers have printed in other steps.
        module: module whose `main` runs steps.
        limit_s: time limit.
    """
    with tempfile.TemporaryFile() as output, tempfile.TemporaryDirectory() as folder:
        file, start_s = Path(folder, "result.json"), time.monotonic()
        number = [] if device is None else [str(device)]
        status = ChildProcesses().run(module, [name, str(file), *number], output, limit_s)
        seconds = time.monotonic() - start_s
        output.seek(0)
        printed = output.read().decode(errors="replace")
        text = file.read_text(encoding="utf-8") if file.exists() else ""
    tops = re.findall(r'hread 0x.*\n +File ".*/(.+)", (line \d+ in \w+)', printed)
    where = f" in {', '.join(tops[-1])}" if tops else ""  # the main thread is the last
    if status is None:
        result = Finding(FAILED, f"not finished within {limit_s:g} s{where}", OTHER_DRIVER)
    elif status < 0:
        name_of_signal = signal.Signals(-status).name
        remedy = f"try MESA_SHADER_CACHE_DISABLE=1 (shaders of another machine), {OTHER_DRIVER}"
        result = Finding(FAILED, f"the driver crashed ({name_of_signal}){where}", remedy)
    elif status or not text:
        last = printed.strip().rpartition("\n")[2]
        result = Finding(FAILED, f"exit status {status}: {last}", "report it, with --report FILE")
    else:
        result = Finding(**json.loads(text))
    lines = [line for line in printed.splitlines() if line.strip() and line not in known]
    if result.status == FAILED and (OTHER_DRIVER in result.remedy or not result.remedy):
        if fault := override_fault(result.text):
            result = result._replace(text=fault.cause, remedy=fault.remedy)
    elif result.status == OK and lines:
        result = Finding(WARNING, *printed_fault(lines[0]), result.details)
    return DoctorStep(name, seconds, result, printed)


def verdict(steps: Sequence[DoctorStep]) -> list[str]:
    """Lines that say whether omnisim works on this machine, and what to do."""
    failed = [step.name for step in steps if step.result.status == FAILED]
    if not failed:
        opengl = next(step.result for step in steps if step.name == "OpenGL")
        is_slow = is_software(opengl.text)
        lines = ["omnisim works here" + (", in software: no GPU is used." if is_slow else ".")]
    elif len(steps) < len(STEPS):
        lines = ["OpenGL cannot be used here; --backend rays renders without it."]
    else:
        lines = [f"OpenGL opens here, but steps fail: {', '.join(failed)}."]
    results = [step.result for step in steps if step.result.status in (FAILED, WARNING)]
    return lines + [f"To do: {text}" for text in dict.fromkeys(r.remedy or r.text for r in results)]


def report(steps: Sequence[DoctorStep], lines: Sequence[str]) -> str:
    """JSON of all steps, without names of the user, the machine and their folders."""
    content = {
        "verdict": list(lines),
        "installation": dict(installation()),
        "variables": {name: os.environ[name] for name in VARIABLES if name in os.environ},
        "steps": [step._asdict() | {"result": step.result._asdict()} for step in steps],
    }
    text = json.dumps(content, indent=2, ensure_ascii=False) + "\n"
    home = os.path.expanduser("~")
    folders = {
        str(PACKAGE.parent): "<omnisim>", sys.prefix: "<python>", str(Path.cwd()): "<folder>",
        home: "~", tempfile.gettempdir(): "<tmp>",
    }  # fmt: skip
    for folder in sorted(folders.keys() - {"/"}, key=len, reverse=True):
        text = re.sub(rf"{re.escape(folder)}(?![\w-])", folders[folder], text)
    text = re.sub(r"/home/[^/\s\"':]+", "/home/<user>", text)
    users = {os.environ.get("USER", ""), os.environ.get("LOGNAME", ""), os.path.basename(home)}
    names = dict.fromkeys(users - {"", "~", "root", "omnisim"}, "<user>")
    for name, instead in {socket.gethostname(): "<host>", **names}.items():
        text = re.sub(rf"(?<![\w-]){re.escape(name)}(?![\w-])", instead, text)
    return text
