"""A camera's degradation in NumPy, slowly: the reference of the GPU's passes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.sensors.degradations.degradation import Degradation
from omnisim.sensors.degradations.effect import Shot
from omnisim.sensors.degradations.encoding import Encoding
from omnisim.sensors.degradations.picture_geometry import LinearPicture, PictureGeometry


def mean_luminance(picture: LinearPicture) -> float:
    """Mean luminance (Rec. 709) of the valid pixels; 0 if there are none."""
    valid = picture[..., 3] > 0.5
    if not np.any(valid):
        return 0.0
    weights = np.array([0.2126, 0.7152, 0.0722])
    return float(np.mean(picture[valid, :3].astype(np.float64) @ weights))


def exposed(
    sub_frames: list[LinearPicture], degradation: Degradation, geometry: PictureGeometry
) -> LinearPicture:
    """Light (height, width, 4) that the sensor collects from ideal pictures of the sub-frames."""
    seen = []
    for picture in sub_frames:
        for effect in degradation.optics:
            picture = effect.apply(picture, geometry)
        seen.append(picture)
    if degradation.shutter is None or len(seen) == 1:
        return seen[-1]
    weights = degradation.shutter.row_weights(len(seen), geometry.height_px)
    total = seen[-1].copy()
    colours = np.stack([picture[..., :3] for picture in seen])
    total[..., :3] = np.sum(weights[:, :, None, None] * colours, axis=0, dtype=np.float32)
    return total


def developed(
    picture: LinearPicture,
    degradation: Degradation,
    geometry: PictureGeometry,
    ev: float,
    noise_key: int,
    frame_number: int,
) -> LinearPicture:
    """Linear picture (height, width, 4) that the sensor makes of the light it has collected."""
    factors = degradation.exposure_factors(ev)
    shot = Shot(factors, degradation.exposure_s, noise_key, frame_number)
    for effect in degradation.electronics:
        picture = effect.apply(picture, geometry, shot)
    return picture


def eight_bits(picture: LinearPicture, degradation: Degradation) -> NDArray[np.uint8]:
    """Values (height, width, 4) of the file, from a linear picture."""
    encoded = (degradation.encoding or Encoding()).apply(picture)
    rgba = np.rint(255.0 * encoded).astype(np.uint8)
    rgba[picture[..., 3] < 0.5] = 0
    return degradation.jpeg.compressed(rgba) if degradation.jpeg else rgba
