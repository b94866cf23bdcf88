"""Estimate of the time of a bake, from some of its tiles."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from omnisim.rendering.baking.bake import Bake

_PROBED_TILES = 2  # per thread


def estimate(bake: Bake, jobs: int | None = None) -> str:
    """Time and size of a bake as text, measured on some of its tiles.

    Args:
        bake: bake to estimate.
        jobs: number of threads; None: one per core.
    """
    threads = jobs or os.cpu_count() or 1
    probes = bake.prober(bake.patches.emission)
    seconds = _seconds(bake.try_tile, bake.tiles, threads)
    seconds += _seconds(probes.bake, probes.tiles, threads)
    width, height = bake.atlas.size_px
    duration = f"{seconds:.0f} seconds" if seconds < 100.0 else f"{seconds / 60.0:.0f} minutes"
    return f"about {duration} for {width} × {height} texels of {bake.texel_m:g} m"


def _seconds(compute: Callable[[int], object], tiles: int, threads: int) -> float:
    """Time of all tiles, extrapolated from evenly spread ones."""
    count = min(tiles, _PROBED_TILES * threads)
    begin_s = time.monotonic()
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(compute, ((2 * at + 1) * tiles // (2 * count) for at in range(count))):
            pass
    return (time.monotonic() - begin_s) * tiles / max(count, 1)
