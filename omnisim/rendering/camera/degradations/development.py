"""Degradation of a camera in NumPy: the reference of the GPU passes, and their fallback."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.camera.degradations.degradation import Degradation
from omnisim.rendering.camera.degradations.effect import Shot
from omnisim.rendering.camera.degradations.encoding import Encoding
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry, LinearImage


def exposed(
    sub_frames: Iterable[tuple[LinearImage, NDArray[np.float32] | None]],
    degradation: Degradation,
    geometry: ImageGeometry,
) -> LinearImage:
    """Light (height, width, 4) collected by the sensor.

    Args:
        sub_frames: at least one ideal image, each with its share (height,) of the rows'
            exposure; None: the whole frame.
        degradation: degradation of the camera.
        geometry: geometry of the image.

    Raises:
        ValueError: there is no sub-frame.
    """
    total: LinearImage | None = None
    for image, row_weights in sub_frames:
        for effect in degradation.optics:
            image = effect.apply(image, geometry)
        if row_weights is not None:
            image = image.copy()
            image[..., :3] *= row_weights[:, None, None]
            if total is not None:
                image[..., :3] += total[..., :3]
        total = image
    if total is None:
        raise ValueError("expected a sub-frame, got none")
    return total


def developed(
    image: LinearImage,
    degradation: Degradation,
    geometry: ImageGeometry,
    factors: tuple[float, float, float],
    noise_key: int,
    frame_number: int,
) -> LinearImage:
    """Linear image (height, width, 4) that the sensor makes from the collected light.

    Args:
        image: collected light.
        degradation: degradation of the camera.
        geometry: geometry of the image.
        factors: exposure factors of red, green and blue light.
        noise_key: key of the camera's random numbers.
        frame_number: frame number of the image.
    """
    shot = Shot(factors, degradation.exposure_s, noise_key, frame_number)
    for effect in degradation.electronics:
        image = effect.apply(image, geometry, shot)
    return image


def eight_bits(image: LinearImage, encoding: Encoding | None) -> NDArray[np.uint8]:
    """File values (height, width, 4) of a linear image; encoding None: an ideal camera's."""
    encoded = (encoding or Encoding()).apply(image)
    rgba: NDArray[np.uint8] = np.rint(255.0 * encoded).astype(np.uint8)
    rgba[image[..., 3] < 0.5] = 0
    return rgba
