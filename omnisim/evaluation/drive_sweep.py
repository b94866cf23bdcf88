"""Sweep: records drives with one varied quantity each, and applies the estimators to them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from omnisim.core.errors import OmnisimError, OutputError, PlanError
from omnisim.core.files.atomic_file import make_folder
from omnisim.core.files.sources import fingerprint
from omnisim.datasets.export.recording import Recording
from omnisim.datasets.generate.workers import threads_shared
from omnisim.evaluation.calibration_error import write_given_run
from omnisim.evaluation.child_process import ChildProcesses
from omnisim.evaluation.run_evaluation import Outcome, estimator_folder, evaluate_estimator
from omnisim.evaluation.sweep_plan import SweepPlan, SweepPoint

RUN, ESTIMATES, GIVEN, OUTPUT = "run", "estimates", "given", "drive.txt"
_TAIL = 300  # characters of a failed drive's message


@dataclass(frozen=True, eq=False)
class PointResult:
    """Outcomes of all estimators at a point of a sweep."""

    point: SweepPoint  # drive and calibration error
    # outcome of each estimator; if the drive failed, each states the drive's error
    outcomes: tuple[Outcome, ...]
    run: Path  # folder of the run
    estimates: Path  # folder with a subfolder for each estimator


def run_sweep(
    plan: SweepPlan, points: Sequence[SweepPoint], folder: Path, processes: int = 1
) -> Iterator[PointResult]:
    """Record the missing drives and apply the estimators; yields results as drives finish.

    Args:
        plan: plan of the sweep.
        points: points of the sweep; those with the same drive share a recording.
        folder: folder with a subfolder for each drive.
        processes: number of concurrent drives.

    Raises:
        OutputError: the folder cannot be written to.
    """
    children = ChildProcesses()
    with threads_shared(processes), ThreadPoolExecutor(processes) as pool:
        try:
            jobs = [
                pool.submit(measure_drive, plan, group, folder, children)
                for group in points_by_drive(points)
            ]
            for job in as_completed(jobs):
                yield from job.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            children.end()
            raise


def points_by_drive(points: Sequence[SweepPoint]) -> list[list[SweepPoint]]:
    """Group points by their drive, in order of the drives' first points."""
    groups: dict[str, list[SweepPoint]] = {}
    for point in points:
        groups.setdefault(point.drive.name, []).append(point)
    return list(groups.values())


def measure_drive(
    plan: SweepPlan, points: Sequence[SweepPoint], folder: Path, children: ChildProcesses
) -> list[PointResult]:
    """Record a drive, or resume it, and apply the estimators at each of its points.

    Args:
        plan: plan of the sweep.
        points: points with the same drive, which differ in the calibration error.
        folder: folder with a subfolder for each drive.
        children: child processes to start and end.

    Raises:
        OutputError: the folder cannot be written to.
    """
    drive = points[0].drive
    drive_folder = folder / drive.name
    make_folder(drive_folder)
    arguments = ["drive", *drive.write(drive_folder), "-o", str((drive_folder / RUN).absolute())]
    with (drive_folder / OUTPUT).open("wb") as output:
        status = children.run("omnisim", arguments, output)
    recording, failure = None, ""
    if status:
        text = (drive_folder / OUTPUT).read_text(encoding="utf-8", errors="replace").strip()
        failure = text[-_TAIL:] or f"exit status {status}"
    else:
        try:
            recording = Recording.read(drive_folder / RUN)
        except OmnisimError as reason:
            failure = str(reason)
    return [_measure(plan, point, drive_folder, recording, failure, children) for point in points]


def _measure(
    plan: SweepPlan,
    point: SweepPoint,
    drive_folder: Path,
    recording: Recording | None,
    failure: str,
    children: ChildProcesses,
) -> PointResult:
    """Apply the estimators to a run, or to its copy with the point's calibration error."""
    given, errors, digest = drive_folder / RUN, point.calibration, ""
    if errors:
        digest = fingerprint(sorted((name, str(error)) for name, error in errors.items()))[:8]
        given = drive_folder / f"{GIVEN}-{digest}"
    estimates = drive_folder / (f"{ESTIMATES}-{digest}" if digest else ESTIMATES)
    outcomes = []
    try:
        if recording is None:
            raise OutputError(f"drive: {failure}")
        if errors:
            write_given_run(recording, errors, given)
    except OmnisimError as reason:
        outcomes = [Outcome(name, "failed", str(reason)) for name in plan.estimators]
        return PointResult(point, tuple(outcomes), drive_folder / RUN, estimates)
    outcomes = [
        evaluate_estimator(
            drive_folder / RUN, name, estimates / estimator_folder(name), plan.limit_s,
            given=given, children=children,
        )
        for name in plan.estimators
    ]  # fmt: skip
    return PointResult(point, tuple(outcomes), drive_folder / RUN, estimates)


def run_sweep_on_ray(
    plan: SweepPlan, points: Sequence[SweepPoint], folder: Path, address: str | None = None
) -> Iterator[PointResult]:
    """Record and evaluate drives on a Ray cluster with shared folders, a task each; yields results.

    Args:
        plan: plan of the sweep.
        points: points of the sweep.
        folder: folder with a subfolder for each drive, which all machines can write.
        address: address of the cluster; None: a cluster on this machine.

    Raises:
        OmnisimError: the first fault other than a failed estimator, or an unreachable cluster.
    """
    import ray  # of an extra

    from omnisim.datasets.generate.ray_cluster import ONE_THREAD, RESTARTS, ray_cluster

    with ray_cluster(address):
        measure = ray.remote(num_cpus=1, max_retries=RESTARTS)(_measured_or_fault)
        pending = [
            measure.options(runtime_env=ONE_THREAD).remote(plan, group, folder.resolve())
            for group in points_by_drive(points)
        ]
        while pending:
            (done,), pending = ray.wait(pending)
            result = ray.get(done)
            if isinstance(result, str):
                raise PlanError(result)
            yield from result


def _measured_or_fault(
    plan: SweepPlan, points: Sequence[SweepPoint], folder: Path
) -> list[PointResult] | str:
    try:
        return measure_drive(plan, points, folder, ChildProcesses())
    except OmnisimError as reason:
        return str(reason)
