"""Time and accuracy of a lidar's revolution, 64 rings × 1024 firings, at rest and in motion.

Run `python -m benchmarks.lidar_cost [SCENE]`; default: mapping. The lidar is 1 m above the scene's
start. Prints medians over the rounds of wall-clock time and of the processor time of all threads,
which other programs hardly change. Accuracy is the share of beams within 1 mm of the ray-casting
back end, in the scene's opaque part.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim import load_scene, open_sensor, pose
from omnisim.core.world import Motion
from omnisim.scene import Scene
from omnisim.scene.model import AlphaMode
from omnisim.sensors.lidar.spinning_lidar import LidarRenderer, PointCloud, SpinningLidar

ROUNDS, WARM_UP = 20, 4
NEAR_M = 1e-3


def _ranges_m(cloud: PointCloud) -> NDArray[np.float64]:
    """Ranges (rings, firings); 0: no point."""
    ranges_m = np.zeros((cloud.lidar.rings, cloud.lidar.firings))
    firings = np.rint(cloud.points["time"] * cloud.lidar.firings / cloud.lidar.period_s)
    ranges_m[cloud.points["ring"], firings.astype(int)] = cloud.points["range"]
    return ranges_m


class TimedCloud(NamedTuple):
    """Point cloud, and the median times of its measurement."""

    cloud: PointCloud
    wall_ms: float
    processor_ms: float

    def __str__(self) -> str:
        """Format both times."""
        return f"{self.wall_ms:.0f} ms, {self.processor_ms:.0f} ms of processors"


def _time(renderer: LidarRenderer, motion: Motion) -> TimedCloud:
    times_s = []
    for _ in range(WARM_UP + ROUNDS):
        start_s = time.perf_counter(), time.process_time()
        cloud = renderer.scan(motion)
        times_s.append((time.perf_counter() - start_s[0], time.process_time() - start_s[1]))
    wall_ms, processor_ms = 1e3 * np.median(times_s[WARM_UP:], axis=0)
    return TimedCloud(cloud, float(wall_ms), float(processor_ms))


def _opaque_part(scene: Scene) -> Scene:
    """Scene without instances that beams may pass through."""
    modes = [scene.materials[mesh.material].alpha_mode for mesh in scene.meshes]
    kept = (instance for instance in scene.instances if modes[instance.mesh] is AlphaMode.OPAQUE)
    return dataclasses.replace(scene, instances=tuple(kept))


def main(source: str) -> None:
    """Print times and accuracy."""
    scene = _opaque_part(load_scene(source))
    lidar = dataclasses.replace(SpinningLidar.hdl64e().without_errors(), firings=1024)
    x_m, y_m, z_m = scene.start.position_m
    # not along walls: a beam exactly along an edge hits either side
    center = pose((x_m, y_m, z_m + 1.0), yaw_deg=scene.start.yaw_deg + 10.0)
    motions: dict[str, Motion] = {
        "at rest": lambda _: center,
        "1 m/s, 0.5 rad/s": lambda time_s: (
            center @ pose((time_s, 0.0, 0.0), yaw_deg=28.65 * time_s)
        ),
    }
    with (
        open_sensor(scene, lidar) as renderer,
        open_sensor(scene, lidar, backend="rays") as rays,
    ):
        for name, motion in motions.items():
            cube, traced = _time(renderer, motion), _time(rays, motion)
            share = np.mean(np.abs(_ranges_m(cube.cloud) - _ranges_m(traced.cloud)) <= NEAR_M)
            print(f"{name:17} cube {cube}; rays {traced}; {share:.3%} within 1 mm")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "mapping")
