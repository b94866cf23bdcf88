"""Sweep on a Ray cluster: one task per drive, which records and evaluates it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import ray

from omnisim.core.errors import OmnisimError, PlanError
from omnisim.datasets.generate.ray_cluster import ONE_THREAD, RESTARTS, ray_cluster
from omnisim.evaluation.child_process import ChildProcesses
from omnisim.evaluation.drive_sweep import PointResult, measure_drive, points_by_drive
from omnisim.evaluation.sweep_plan import SweepPlan, SweepPoint


def run_sweep_on_ray(
    plan: SweepPlan, points: Sequence[SweepPoint], folder: Path, address: str | None = None
) -> Iterator[PointResult]:
    """Record and evaluate drives on a cluster with shared folders; yields results.

    Args:
        plan: plan of the sweep.
        points: points of the sweep.
        folder: folder with a subfolder for each drive, which all machines can write.
        address: address of the cluster; None: a cluster on this machine.

    Raises:
        OmnisimError: the first fault other than a failed estimator, or an unreachable cluster.
    """
    with ray_cluster(address):
        measure = ray.remote(num_cpus=1, max_retries=RESTARTS)(_measure)
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


def _measure(
    plan: SweepPlan, points: Sequence[SweepPoint], folder: Path
) -> list[PointResult] | str:
    """Results of a drive's points, or the message of a fault."""
    try:
        return measure_drive(plan, points, folder, ChildProcesses())
    except OmnisimError as reason:
        return str(reason)
