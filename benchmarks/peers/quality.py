"""Quality of the images in the race: PSNR against references with 64 samples per pixel."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.ours import Omnisim
from benchmarks.peers.peer import CAMERA, SENSOR, ImagePeer, mirror_rays
from omnisim.rendering.stage import Stage
from omnisim.validation.image_differences import psnr_of_levels_db

CAPTURES = 8  # samples along each side of a pixel
REFERENCE = dataclasses.replace(SENSOR, supersampling=CAPTURES, texels_per_pixel=float(CAPTURES))
TRUTH = "64 samples"  # the reference that most are measured against
BEST_DB = 99.0  # of images that are equal: a report holds finite numbers


def references(
    stage: Stage, poses: NDArray[np.float64], unlit: bool = False
) -> list[NDArray[np.uint8]]:
    """RGBA images with 8 × 8 samples per pixel, and as many texels."""
    with Omnisim(stage, REFERENCE, "reference", unlit) as reference:
        return [reference.render(pose) for pose in poses]


def psnr_db(image: NDArray[np.uint8], reference: NDArray[np.uint8]) -> float:
    """PSNR of the sRGB levels of two images (height, width, 3 or 4), over pixels valid in both.

    A pixel is valid if its center shows the mirror, and its alpha, if any, is not 0.
    """
    _, where = mirror_rays(CAMERA)
    for one in (image, reference):
        if one.shape[2] == 4:
            where = where & (one[..., 3] > 0)
    return min(BEST_DB, psnr_of_levels_db(image[where][:, :3], reference[where][:, :3]))


def measured_db(
    peer: ImagePeer, poses: NDArray[np.float64], against: list[NDArray[np.uint8]]
) -> NDArray[np.float64]:
    """PSNR (n,) of a renderer's images from poses (n, 4, 4), against references."""
    return np.array(
        [
            psnr_db(peer.render(pose), reference)
            for pose, reference in zip(poses, against, strict=True)
        ]
    )
