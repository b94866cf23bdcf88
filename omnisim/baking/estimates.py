"""Estimate of a bake's time, from some of its tiles."""

from __future__ import annotations

import os
import time
from concurrent.futures import ThreadPoolExecutor

from omnisim.baking.bake import Bake

_PROBED_TILES = 2  # by each thread


def estimate(bake: Bake, jobs: int | None = None) -> str:
    """Time and size of a bake in words, after some of its tiles were tried.

    Args:
        bake: to estimate.
        jobs: threads; None: one for each core.
    """
    threads = jobs or os.cpu_count() or 1
    count = min(bake.tiles, _PROBED_TILES * threads)
    tiles = [(2 * number + 1) * bake.tiles // (2 * count) for number in range(count)]
    begin_s = time.monotonic()
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(bake.try_tile, tiles):
            pass
    seconds = (time.monotonic() - begin_s) * bake.tiles / max(count, 1)
    width, height = bake.atlas.size_px
    words = f"{seconds:.0f} seconds" if seconds < 100.0 else f"{seconds / 60.0:.0f} minutes"
    return f"about {words} for {width} × {height} texels of {bake.texel_m:g} m"
