"""Processor time of ground truth relative to the image.

Run `python -m benchmarks.ground_truth_cost [SCENE]`; default: the soccer field. Prints medians of
interleaved rounds. Processor time is used because other programs hardly change it.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from omnisim import OmniCamera, load_scene, open_sensor, pose
from omnisim.ground_truth import CHANNELS

ROUNDS = 9  # after one to warm up
BACKWARD_AND_SCENE = tuple(n for n in CHANNELS if "backward" in n or "scene_flow" in n)
VARIANTS: dict[str, tuple[str, ...]] = {
    "image": (),
    "range, instance": ("range", "instance"),
    "all but flows": tuple(name for name in CHANNELS if not CHANNELS[name].other),
    "all but backward and scene flow": tuple(n for n in CHANNELS if n not in BACKWARD_AND_SCENE),
    "all but backward flow": tuple(name for name in CHANNELS if "backward" not in name),
    "all": tuple(CHANNELS),
    "3-D boxes": (),
}


def main(source: str) -> None:
    """Print the times of all variants, in both qualities."""
    scene = load_scene(source)
    for quality in ("default", "fast"):
        camera = OmniCamera().with_quality(quality)
        current = camera.base_pose(scene.start.position_m, yaw_deg=scene.start.yaw_deg)
        next_pose = current @ pose((0.1, 0.0, 0.0), yaw_deg=4.0)
        times_s: dict[str, list[float]] = {name: [] for name in VARIANTS}
        with open_sensor(scene, camera) as renderer:
            for _ in range(1 + ROUNDS):
                for name, also in VARIANTS.items():
                    start_s = time.process_time()
                    renderer.render(
                        current,
                        also=also,
                        next_state=next_pose,
                        previous_state=next_pose,
                        boxes_3d=name == "3-D boxes",
                    )
                    times_s[name].append(time.process_time() - start_s)
        medians_s = {name: float(np.median(all_s[1:])) for name, all_s in times_s.items()}
        for name, median_s in medians_s.items():
            share = median_s / medians_s["image"]
            print(f"{quality:8} {name:32} {1e3 * median_s:6.1f} ms  {share:.2f} ×")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "soccer")
