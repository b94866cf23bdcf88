"""Shards on a Ray cluster: a task per shard, in actors with their own renderer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import ray

from omnisim.core.errors import OmnisimError, PlanError
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.datasets.generate.ray_cluster import ONE_THREAD, RESTARTS, ray_cluster
from omnisim.datasets.generate.shard import ShardMaker
from omnisim.datasets.generate.workers import Job, ShardProgress


class _Maker:
    """Actor that reads the plan once and generates shards."""

    def __init__(self, job: Job):
        self._maker = ShardMaker(PreparedPlan.read(job.plan, job.folder), job.folder, job.device)

    def make(self, number: int) -> int | str:
        """Generate a shard; return its number, or the error message."""
        try:
            self._maker.make(number)
        except OmnisimError as error:
            return str(error)
        return number


def make_shards_on_ray(
    job: Job, shards: Sequence[int], address: str | None = None
) -> Iterator[ShardProgress]:
    """Generate shards on a cluster whose machines share the plan and the folder; yield after each.

    Args:
        job: arguments of the workers.
        shards: numbers of the shards.
        address: address of the cluster; None: a cluster on this machine.

    Raises:
        OmnisimError: the first fault of a shard, or an unreachable cluster.
    """
    if not shards:
        return
    job = job._replace(plan=Path(job.plan).resolve(), folder=Path(job.folder).resolve())
    with ray_cluster(address):
        resources: dict[str, float] = ray.cluster_resources()  # type: ignore[no-untyped-call]
        count = min(len(shards), max(1, int(resources.get("CPU", 1))))
        actor = ray.remote(num_cpus=1, max_restarts=RESTARTS, max_task_retries=RESTARTS)(_Maker)
        makers = [actor.options(runtime_env=ONE_THREAD).remote(job) for _ in range(count)]
        pool = ray.util.ActorPool(makers)
        steps: Iterator[int | str] = pool.map_unordered(_begin, list(shards))
        for result in steps:
            if isinstance(result, str):
                raise PlanError(result)
            yield ShardProgress(result, True)


def _begin(maker: Any, number: int) -> Any:
    return maker.make.remote(number)
