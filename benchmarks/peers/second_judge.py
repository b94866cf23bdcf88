"""Second reference, with 8 × 8 of Embree's rays per pixel: a check of the first reference.

Run `python -m benchmarks.peers.second_judge soccer`.
"""

from __future__ import annotations

import math
import sys

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers import field
from benchmarks.peers.field import Field
from benchmarks.peers.path import race_poses
from benchmarks.peers.peer import CAMERA
from benchmarks.peers.quality import CAPTURES, psnr_db, references
from omnisim.core.srgb import srgb8_from_linear
from omnisim.rendering.rays.caster import DepthLimits
from omnisim.rendering.rays.ray_backend import RayImage
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.rendering.stage import Stage
from omnisim.scene import Scene, load_scene
from omnisim.scene.files.load import NO_BAKED_LIGHT, NO_SKY

POSES, POSE_INDEX = 10, 4
COMPARED = (field.FAST, field.DEFAULT, field.PAPER, field.GAZEBO, field.EMBREE_COLOR)


def by_embree(scene: Scene, world_from_rig: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Image (height, width, 3) from 64 rays per pixel, averaged in linear light."""
    samples = CAMERA.scaled(CAPTURES)
    image = RayImage(RayScene(scene), samples, None, CAPTURES, DepthLimits(0.0, math.inf))
    return srgb8_from_linear(image.render(world_from_rig, ObjectState())[..., :3])


def main(scene: str) -> None:
    """Print the PSNR of each renderer's image against both references."""
    with Stage(load_scene(scene, sky=NO_SKY, baked=NO_BAKED_LIGHT)) as stage:
        pose = race_poses(stage, POSES)[POSE_INDEX]
        ours = references(stage, pose[None])[0]
        theirs = by_embree(stage.scene, pose)
        with Field(stage) as racers:
            images = {name: racers.images[name].render(pose) for name in COMPARED}
    print(f"{scene}: our reference against Embree's: {psnr_db(ours, theirs):.1f} dB")
    for name, image in images.items():
        print(
            f"{name:20} against ours {psnr_db(image, ours):.1f} dB, "
            f"against Embree's {psnr_db(image, theirs):.1f} dB"
        )


if __name__ == "__main__":
    main(sys.argv[1])
