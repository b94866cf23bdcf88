"""Sweep on a Ray cluster: one task per drive, which records and evaluates it."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from pathlib import Path

import ray

from omnisim.core.errors import OmnisimError, PlanError
from omnisim.evaluation.child_process import ChildProcesses
from omnisim.evaluation.drive_sweep import PointResult, measure_drive, points_by_drive
from omnisim.evaluation.sweep_plan import SweepPlan, SweepPoint

RETRIES = 3  # of a task whose process or machine dies


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
    try:
        ray.init(
            address=address,
            include_dashboard=False,
            log_to_driver=False,
            logging_level=logging.ERROR,
        )
    except Exception as reason:  # a node that starts too late raises a bare Exception
        where = "ray" if address is None else f"--address {address}"
        raise PlanError(f"{where}: {str(reason).partition(chr(10))[0]}") from None
    try:
        environment = {"env_vars": {"LP_NUM_THREADS": "1"}}
        measure = ray.remote(num_cpus=1, max_retries=RETRIES)(_measure)
        pending = [
            measure.options(runtime_env=environment).remote(plan, group, folder.resolve())
            for group in points_by_drive(points)
        ]
        while pending:
            (done,), pending = ray.wait(pending)
            result = ray.get(done)
            if isinstance(result, str):
                raise PlanError(result)
            yield from result
    except ray.exceptions.RayError as reason:
        raise PlanError(f"ray: {str(reason).partition(chr(10))[0]}") from None
    finally:
        ray.shutdown()


def _measure(
    plan: SweepPlan, points: Sequence[SweepPoint], folder: Path
) -> list[PointResult] | str:
    """Results of a drive's points, or the message of a fault."""
    try:
        return measure_drive(plan, points, folder, ChildProcesses())
    except OmnisimError as reason:
        return str(reason)
