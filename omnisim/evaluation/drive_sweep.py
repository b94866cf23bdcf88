"""Sweeps: drives that vary in one key, and estimators on each."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from omnisim.core.errors import OmnisimError, OutputError
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.outcome import Outcome
from omnisim.evaluation.run_evaluation import estimator_folder, evaluate_estimator
from omnisim.evaluation.sweep_plan import SweepPlan, SweepPoint

RUN, ESTIMATES = "run", "estimates"
_TAIL = 300  # characters of a failed drive's message


@dataclass(frozen=True, eq=False)
class PointResult:
    """Estimators on a drive of a sweep.

    Attributes:
        point: the drive.
        outcomes: outcome of each estimator; a failed drive gives its reason to all of them.
    """

    point: SweepPoint
    outcomes: tuple[Outcome, ...]


def run_sweep(
    plan: SweepPlan, points: list[SweepPoint], base: Path, folder: Path, processes: int = 1
) -> Iterator[PointResult]:
    """Record the missing drives, and apply the estimators; yield results in order.

    Args:
        plan: plan of the sweep.
        points: drives of the sweep.
        base: folder of the plan, at which relative paths start.
        folder: folder with a subfolder for each drive.
        processes: number of concurrent drives.

    Raises:
        OutputError: the folder cannot be written to.
    """
    with ThreadPoolExecutor(processes) as pool:
        try:
            jobs = [pool.submit(_result, plan, point, base, folder) for point in points]
            for job in jobs:
                yield job.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _result(plan: SweepPlan, point: SweepPoint, base: Path, folder: Path) -> PointResult:
    place = folder / point.name
    try:
        place.mkdir(parents=True, exist_ok=True)
        robot = point.write_robot(place)
    except OSError as reason:
        raise OutputError(f"{place}: cannot be written to: {reason.strerror}") from None
    failure = _drive(plan, point, base, robot, place / RUN)
    if failure is None:
        try:
            Recording.read(place / RUN)
        except OmnisimError as reason:
            failure = str(reason)
    if failure is not None:
        outcomes = [Outcome(name, "failed", f"drive: {failure}") for name in plan.estimators]
        return PointResult(point, tuple(outcomes))
    outcomes = [
        evaluate_estimator(
            place / RUN, name, place / ESTIMATES / estimator_folder(name), plan.limit_s
        )
        for name in plan.estimators
    ]
    return PointResult(point, tuple(outcomes))


def _drive(plan: SweepPlan, point: SweepPoint, base: Path, robot: Path, run: Path) -> str | None:
    """Record a drive, or resume it; reason of a failure, or None."""
    words = [sys.executable, "-m", "omnisim", "drive", _place(base, plan.scene)]
    words += ["--robot", str(robot.absolute()), "--path", _place(base, plan.path)]
    words += ["-o", str(run.absolute()), "--seed", str(point.seed)]
    for key, value in plan.drive.items():
        flag = f"--{key.replace('_', '-')}"
        words += [flag] if value is True else [flag, str(value)]
    done = subprocess.run(
        words, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False
    )
    return None if done.returncode == 0 else done.stderr.strip()[-_TAIL:]


def _place(base: Path, name: str) -> str:
    """Absolute path of a file of the plan; a built-in name stays unchanged."""
    is_path = "/" in name or bool(Path(name).suffix)
    return str((base / name).absolute()) if is_path else name
