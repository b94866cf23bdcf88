"""Start-up: time from a new process to its first image."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from benchmarks.start_up_phases import AFTER, PHASES
from omnisim.report.machine import ROOT

# With the driver's shader cache, and without.
CACHED, ANEW = "to an image and the end", "shaders compiled anew"

# The installed command, run on this checkout.
_COMMAND = "from omnisim.apps.cli.start import main; main()"
# Disable the shader caches of Mesa and NVIDIA on disk.
_NO_CACHE = {"MESA_SHADER_CACHE_DISABLE": "true", "__GL_SHADER_DISK_CACHE": "0"}
_NOW = "NOW"  # stands for the time at which the process is started


class Run(NamedTuple):
    """Times and output of a process."""

    seconds: float  # by the wall clock
    processor_seconds: float  # of all its threads; other load hardly changes it
    output: str


def start_up_rows(scene: str, starts: int, options: Options) -> list[dict[str, Any]]:
    """Rows of a report: whole runs with and without the driver's shader cache, and their phases.

    Args:
        scene: name or file.
        starts: number of starts per variant, after one that fills the cache; 0: no rows.
        options: device and progress.

    Raises:
        BenchmarkError: a process fails.
    """
    if not starts:
        return []
    if Path(scene).is_file():
        scene = str(Path(scene).resolve())  # the processes start elsewhere
    runs: dict[str, list[Run]] = {CACHED: [], ANEW: []}
    phases: dict[str, list[float]] = {phase: [] for phase in PHASES}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frame.png"
        render(scene, path, options.device)
        for _ in options.progress(range(starts), "start-up", starts):
            for what, done in runs.items():
                done.append(render(scene, path, options.device, cached=what == CACHED))
            for phase, seconds in phase_seconds(scene, path, options.device).items():
                phases[phase].append(seconds)
    rows: list[dict[str, Any]] = [
        {"kind": "start-up", "what": what, "rounds": starts,
         **_statistics("seconds", [run.seconds for run in done]),
         **_statistics("processor_seconds", [run.processor_seconds for run in done])}
        for what, done in runs.items()
    ]  # fmt: skip
    rows += [
        {
            "kind": "start-up phase",
            "what": phase,
            "rounds": starts,
            **_statistics("seconds", seconds),
        }
        for phase, seconds in phases.items()
    ]
    return rows


def _statistics(name: str, values: list[float]) -> dict[str, float]:
    return {
        name: float(np.median(values)),
        f"{name}_least": min(values),
        f"{name}_most": max(values),
    }


def render(scene: str, path: Path, device: int | None, cached: bool = True) -> Run:
    """Run `omnisim render SCENE -o PATH` in a new process.

    Args:
        scene: name or file.
        path: path of the image.
        device: EGL index of the GPU; None: the first.
        cached: let the driver use its shader cache.

    Raises:
        BenchmarkError: the process fails.
    """
    options = [] if device is None else ["--device", str(device)]
    arguments = ["-c", _COMMAND, "render", scene, "-o", str(path), *options]
    return _run(arguments, {} if cached else _NO_CACHE)


def phase_seconds(scene: str, path: Path, device: int | None) -> dict[str, float]:
    """Seconds of each phase of a new process, see `start_up_phases`.

    Raises:
        BenchmarkError: the process fails.
    """
    numbers = [] if device is None else [str(device)]
    arguments = ["-m", "benchmarks.start_up_phases", _NOW, scene, str(path), *numbers]
    done = _run(arguments, {})
    phases: dict[str, float] = json.loads(done.output)
    phases[AFTER] = done.seconds - sum(phases.values())
    return phases


def _run(arguments: Sequence[str], more: dict[str, str]) -> Run:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.monotonic()  # which all processes share
    given = [str(start) if argument is _NOW else argument for argument in arguments]
    done = subprocess.run(
        [sys.executable, *given], cwd=ROOT, env={**os.environ, **more},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    seconds = time.monotonic() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no word why"])[-1]
        raise BenchmarkError(f"start-up: a fresh process failed: {last}")
    busy = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return Run(seconds, busy, done.stdout)
