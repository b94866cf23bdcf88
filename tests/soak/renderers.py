"""Renderers that are opened and dropped: the process's memory stays what it was."""

import gc
import os
import warnings
from pathlib import Path

from omnisim import LaserScanner, OmniCamera, open_sensor
from omnisim.core.poses import pose
from tests.scenes import room, scene_of

WARM = 20  # renderers until all that is kept once is there
# Bytes to a renderer. Measured: 26 kB over 30 and 6 kB over 1000, as what is kept once comes late;
# a renderer that is never released has 6.6 MB, one in an OpenGL context of its own 66 kB.
MAX_GROWTH = 50e3
CAMERA = OmniCamera(polygons=None).resized(24)


def resident_bytes() -> int:
    """Resident memory of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def renderers(times: int, print_line=print) -> float:
    """Open and drop `times` renderers of a camera, and of a laser scanner every tenth time.

    Returns:
        Growth of the resident memory in bytes to a renderer, after the first `WARM`.
    """
    before = 0
    for number in range(1, times + 1):
        scene = scene_of([room()])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)
            renderer = open_sensor(scene, CAMERA)
            renderer.render(pose())
            if number % 2:
                renderer.close()
            if number % 10 == 0:
                open_sensor(scene, LaserScanner()).scan(pose())
            del renderer
            gc.collect()
        if number == WARM:
            before = resident_bytes()
        if number % 50 == 0:
            growth = resident_bytes() - before
            print_line(f"{number} of {times} renderers: {growth / 1e6:+.1f} MB since {WARM}")
    return (resident_bytes() - before) / (times - WARM)
