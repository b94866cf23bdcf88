"""Second reference, by Embree with 8 × 8 rays per pixel: is the first one fair to all?

python -m benchmarks.peers.second_judge soccer
"""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers import field
from benchmarks.peers.embree import EmbreeColors
from benchmarks.peers.field import Field
from benchmarks.peers.path import race_poses
from benchmarks.peers.peer import CAMERA
from benchmarks.peers.quality import CAPTURES, psnr_db, references
from omnisim.scene import load_scene
from omnisim.sensors import Stage
from omnisim.srgb import LINEAR_FROM_SRGB8, srgb8_from_linear

POSES, LOOKED_AT = 10, 4
COMPARED = (field.FAST, field.DEFAULT, field.PAPER, field.GAZEBO, field.EMBREE_COLOR)


def by_embree(racer: EmbreeColors, pose: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Picture (height, width, 3) of 64 rays per pixel, averaged in linear light."""
    levels = LINEAR_FROM_SRGB8
    total = np.zeros((CAMERA.height_px, CAMERA.width_px, 3))
    count = np.zeros((CAMERA.height_px, CAMERA.width_px, 1))
    shifts = (np.arange(CAPTURES) + 0.5) / CAPTURES - 0.5
    for right in shifts:
        for down in shifts:
            u, v = CAMERA.principal_point_px
            shifted = dataclasses.replace(CAMERA, principal_point_px=(u - right, v - down))
            racer.rays.look_through(shifted)
            total += levels[racer.render(pose)] * racer.rays.valid[..., None]
            count += racer.rays.valid[..., None]
    racer.rays.look_through(CAMERA)
    mean = total / np.maximum(count, 1.0)
    return srgb8_from_linear(mean)


def main(scene: str) -> None:
    """Print the PSNR of each racer's picture against both references."""
    with Stage(load_scene(scene)) as stage:
        pose = race_poses(stage, POSES)[LOOKED_AT]
        ours = references(stage, pose[None])[0]
        with Field(stage) as racers:
            pictures = {name: racers.pictures[name].render(pose) for name in COMPARED}
            embree = racers.pictures[field.EMBREE_COLOR]
            assert isinstance(embree, EmbreeColors)
            theirs = by_embree(embree, pose)
    print(f"{scene}: our reference against Embree's: {psnr_db(ours, theirs):.1f} dB")
    for name, picture in pictures.items():
        print(
            f"{name:20} against ours {psnr_db(picture, ours):.1f} dB, "
            f"against Embree's {psnr_db(picture, theirs):.1f} dB"
        )


if __name__ == "__main__":
    main(sys.argv[1])
