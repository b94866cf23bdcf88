"""The whole chain in NumPy: what the GPU's passes are compared with, and slow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.sensors.degradations.degradation import Degradation
from omnisim.sensors.degradations.encoding import Encoding
from omnisim.sensors.degradations.picture_geometry import Picture, PictureGeometry
from omnisim.sensors.degradations.reflectance import multiplied


def mean_luminance(picture: Picture) -> float:
    """Mean luminance (Rec. 709) of the valid pixels; 0 if there are none."""
    valid = picture[..., 3] > 0.5
    if not np.any(valid):
        return 0.0
    weights = np.array([0.2126, 0.7152, 0.0722])
    return float(np.mean(picture[valid, :3].astype(np.float64) @ weights))


def exposed(
    sub_frames: list[Picture], degradation: Degradation, geometry: PictureGeometry
) -> Picture:
    """The light that the sensor collects from ideal pictures of the sub-frames."""
    seen = []
    for picture in sub_frames:
        for name in ("reflectance", "dirt", "defocus", "vignetting", "chromatic_aberration"):
            part = degradation.parts.get(name)
            picture = picture if part is None else part.apply(picture, geometry)
        seen.append(picture)
    if degradation.shutter is None or len(seen) == 1:
        return seen[-1]
    weights = degradation.shutter.row_weights(len(seen), geometry.height_px)
    total = seen[-1].copy()
    colours = np.stack([picture[..., :3] for picture in seen])
    total[..., :3] = np.sum(weights[:, :, None, None] * colours, axis=0, dtype=np.float32)
    return total


def developed(
    picture: Picture,
    degradation: Degradation,
    geometry: PictureGeometry,
    ev: float,
    key: int,
    frame_number: int,
) -> Picture:
    """The linear picture that comes out of the sensor, from the light that it has collected."""
    if degradation.exposure or degradation.white_balance:
        picture = multiplied(picture, degradation.exposure_factors(ev))
    if degradation.noise:
        picture = degradation.noise.apply(
            picture, geometry, key, degradation.exposure_s, frame_number
        )
    for part in (degradation.bayer, degradation.white_balance):
        picture = part.apply(picture, geometry) if part else picture
    return picture


def eight_bits(
    picture: Picture, degradation: Degradation, geometry: PictureGeometry
) -> NDArray[np.uint8]:
    """The file's numbers (height, width, 4), from a linear picture."""
    encoded = (degradation.encoding or Encoding()).apply(picture, geometry)
    rgba = np.rint(255.0 * encoded).astype(np.uint8)
    rgba[picture[..., 3] < 0.5] = 0
    return degradation.jpeg.compressed(rgba) if degradation.jpeg else rgba
