"""Connection to a Ray cluster."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import ray

from omnisim.core.errors import OmnisimError, PlanError
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.datasets.generate.shard import ShardMaker
from omnisim.datasets.generate.workers import SampleJob, ShardProgress

# A task's process rasterizes with one thread: each core has a task of its own.
ONE_THREAD: dict[str, Any] = {"env_vars": {"LP_NUM_THREADS": "1"}}
RESTARTS = 3  # of a task or an actor whose process or machine dies


@contextmanager
def ray_cluster(address: str | None = None) -> Iterator[None]:
    """Connect to a cluster, or to one started on this machine, and disconnect at the end.

    Raises:
        PlanError: the cluster is unreachable, or a task fails.
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
        raise PlanError(f"{where}: {_first_line(reason)}") from None
    try:
        yield
    except ray.exceptions.RayError as reason:
        raise PlanError(f"ray: {_first_line(reason)}") from None
    finally:
        ray.shutdown()


def _first_line(reason: Exception) -> str:
    return str(reason).partition("\n")[0]


# Shards on a Ray cluster: a task per shard, in actors with their own renderer.


class _Maker:
    """Actor that reads the plan once and generates shards."""

    def __init__(self, job: SampleJob):
        self._maker = ShardMaker(PreparedPlan.read(job.plan, job.folder), job.folder, job.device)

    def make(self, number: int) -> int | str:
        """Generate a shard; return its number, or the error message."""
        try:
            self._maker.make(number)
        except OmnisimError as error:
            return str(error)
        return number


def make_shards_on_ray(
    job: SampleJob, shards: Sequence[int], address: str | None = None
) -> Iterator[ShardProgress]:
    """Generate shards on a cluster whose machines share the plan and the folder; yield after each.

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
        steps: Iterator[int | str] = pool.map_unordered(
            lambda maker, number: maker.make.remote(number), list(shards)
        )
        for result in steps:
            if isinstance(result, str):
                raise PlanError(result)
            yield ShardProgress(result, True)
