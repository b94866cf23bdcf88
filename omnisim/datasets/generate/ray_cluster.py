"""Connection to a Ray cluster."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import ray

from omnisim.core.errors import PlanError

# A task's process rasterizes with one thread: each core has a task of its own.
ONE_THREAD: dict[str, Any] = {"env_vars": {"LP_NUM_THREADS": "1"}}
RESTARTS = 3  # of a task or an actor whose process or machine dies


@contextmanager
def ray_cluster(address: str | None = None) -> Iterator[None]:
    """Connect to a cluster, and disconnect at the end.

    Args:
        address: address of the cluster; None: start one on this machine.

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
