"""Degradation of a camera in NumPy: the reference of the GPU's passes, and their stand-in."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.camera.degradations.degradation import Degradation
from omnisim.rendering.camera.degradations.effect import Shot
from omnisim.rendering.camera.degradations.encoding import Encoding
from omnisim.rendering.camera.degradations.picture_geometry import LinearPicture, PictureGeometry


def mean_luminance(picture: LinearPicture) -> float:
    """Mean luminance (Rec. 709) of the valid pixels; 0 if there are none."""
    valid = picture[..., 3] > 0.5
    if not np.any(valid):
        return 0.0
    weights = np.array([0.2126, 0.7152, 0.0722])
    return float(np.mean(picture[valid, :3].astype(np.float64) @ weights))


def exposed(
    sub_frames: Iterable[tuple[LinearPicture, NDArray[np.float32] | None]],
    degradation: Degradation,
    geometry: PictureGeometry,
) -> LinearPicture:
    """Light (height, width, 4) that the sensor collects.

    Args:
        sub_frames: ideal pictures, at least one, each with the share (height,) of its rows'
            exposure; None: it is the whole frame.
        degradation: of the camera.
        geometry: of the picture.

    Raises:
        ValueError: no sub-frame.
    """
    total: LinearPicture | None = None
    for picture, row_weights in sub_frames:
        for effect in degradation.optics:
            picture = effect.apply(picture, geometry)
        if row_weights is not None:
            picture = picture.copy()
            picture[..., :3] *= row_weights[:, None, None]
            if total is not None:
                picture[..., :3] += total[..., :3]
        total = picture
    if total is None:
        raise ValueError("expected a sub-frame, got none")
    return total


def developed(
    picture: LinearPicture,
    degradation: Degradation,
    geometry: PictureGeometry,
    factors: tuple[float, float, float],
    noise_key: int,
    frame_number: int,
) -> LinearPicture:
    """Linear picture (height, width, 4) that the sensor makes of the light it has collected.

    Args:
        picture: the light.
        degradation: of the camera.
        geometry: of the picture.
        factors: of the exposure of red, green and blue light.
        noise_key: of the camera's random numbers.
        frame_number: of the picture.
    """
    shot = Shot(factors, degradation.exposure_s, noise_key, frame_number)
    for effect in degradation.electronics:
        picture = effect.apply(picture, geometry, shot)
    return picture


def eight_bits(picture: LinearPicture, encoding: Encoding | None) -> NDArray[np.uint8]:
    """Values (height, width, 4) of the file, from a linear picture; None: an ideal camera's."""
    encoded = (encoding or Encoding()).apply(picture)
    rgba: NDArray[np.uint8] = np.rint(255.0 * encoded).astype(np.uint8)
    rgba[picture[..., 3] < 0.5] = 0
    return rgba
