"""Optical systems on the virtual cameras: accuracy against Embree's rays, and frame times.

    python -m benchmarks.optical_systems [SCENE ...] [--systems NAME ...] [--rounds N]

Default scenes: the soccer field and mapping. Each system of `examples/optics` is measured at the
scene's start, and 0.2 m beside the nearest object there. Accuracy is the share of pixels with the
same triangle as Embree's exact ray: with undecided pixels cast as rays, without casting, and of
decided pixels alone; and the share of undecided pixels. Frame times are relative to the paper's
mirror, both at 360 × 360 px and default quality, in interleaved rounds. The time of the first frame
includes opening the sensor. The share of undecided samples is printed, too.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim import OmniCamera, load_scene
from omnisim.cameras.optics import read_optics_file
from omnisim.rendering.rays.ray_scene import RayScene
from omnisim.rendering.stage import Stage
from omnisim.scene import Scene
from omnisim.validation.checks.optics import BESIDE_M, pose_beside_nearest, same_triangles

EXAMPLES = Path(__file__).parents[1] / "examples" / "optics"
SYSTEMS = ("tilted-mirror", "sphere", "cone", "equi-angular", "folded")
SIZE_PX = 360

Pose = NDArray[np.float64]


def main() -> None:
    """Print accuracy and times."""
    parser = argparse.ArgumentParser(description="Accuracy and time of optical systems.")
    parser.add_argument("scenes", nargs="*", default=["soccer", "mapping"])
    parser.add_argument("--systems", nargs="+", default=list(SYSTEMS))
    parser.add_argument("--rounds", type=int, default=12)
    options = parser.parse_args()
    for source in options.scenes:
        scene = load_scene(source)
        with Stage(scene) as stage:
            rays = RayScene(scene)
            for name in options.systems:
                system = read_optics_file(EXAMPLES / f"{name}.toml")
                sensor = OmniCamera(system.scaled(SIZE_PX / system.width_px))
                print(f"{scene.name}, {name}")
                for place, base in places(sensor, scene, rays).items():
                    print(f"  {place}: {accuracy(stage, rays, sensor, base)}")
                    print(f"  {place}: {times(stage, sensor, base, options.rounds)}", flush=True)


def places(sensor: OmniCamera, scene: Scene, rays: RayScene) -> dict[str, Pose]:
    """Poses (4, 4) of the base: at the start of a scene, and beside the nearest object there."""
    start = sensor.base_pose(scene.start.position_m, yaw_deg=scene.start.yaw_deg)
    beside = pose_beside_nearest(sensor, rays, start)
    return {"start": start, f"{BESIDE_M} m beside": beside}


def accuracy(stage: Stage, rays: RayScene, sensor: OmniCamera, base: Pose) -> str:
    """Line with the shares of pixels."""
    shares = same_triangles(stage, rays, sensor, base)
    return (
        f"same triangle {shares.cast:.3%} with rays, {shares.alone:.3%} without, "
        f"{shares.decided:.3%} of those decided; {shares.undecided:.2%} undecided"
    )


def times(stage: Stage, sensor: OmniCamera, base: Pose, rounds: int) -> str:
    """Line with the processor time of a frame, relative to that of the paper's mirror."""
    paper = OmniCamera()
    with stage.open(paper) as reference:
        reference.render(base)
        start_s = time.process_time(), time.perf_counter()
        with stage.open(sensor) as renderer:
            frame = renderer.render(base)
            first_s = time.process_time() - start_s[0], time.perf_counter() - start_s[1]
            spent: list[tuple[float, float, float, float]] = []
            for _ in range(rounds):
                moments = []
                for one in (reference, renderer):
                    moments += [time.process_time(), time.perf_counter()]
                    frame = one.render(base)
                    moments += [time.process_time(), time.perf_counter()]
                a, b, c, d, e, f, g, h = moments
                spent.append((c - a, d - b, g - e, h - f))
    paper_cpu_s, paper_s, cpu_s, wall_s = np.array(spent[2:]).T
    undecided = frame.metadata["undecided"]["samples"]
    samples = sensor.supersampling**2 * int(frame.valid.sum())
    return (
        f"{np.median(cpu_s / paper_cpu_s):.2f} × the paper's mirror "
        f"({np.median(wall_s / paper_s):.2f} by the clock), {1e3 * np.median(cpu_s):.0f} ms; "
        f"first frame {first_s[0]:.2f} s ({first_s[1]:.2f} by the clock); "
        f"{undecided / samples:.2%} of the samples undecided"
    )


if __name__ == "__main__":
    main()
