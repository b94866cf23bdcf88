"""Capture quality: texels of the virtual cameras and samples per pixel, by a name or by numbers.

Both numbers are about jagged edges and lost detail, at two places: texels to a side of the
image's finest pixels, and samples to a side of each pixel, which are averaged. The names are
settings where neither is finer than the other can show.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from omnisim.core.errors import OpticsError, did_you_mean

MAX_IMAGE_PX = 32768  # what any GPU of today allows; the one at hand may allow less
MAX_SUPERSAMPLING = 8
MIN_DENSITY, MAX_DENSITY = 0.25, 8.0  # texels of the virtual cameras to a side of a pixel

QualityName = Literal["fast", "default", "fine"]


class CaptureQuality(NamedTuple):
    """Texels and samples of a capture.

    Attributes:
        supersampling: samples to a side of a pixel of the image.
        texels_per_pixel: texels of the virtual cameras to a side of the image's finest pixels.
    """

    supersampling: int
    texels_per_pixel: float


QUALITIES: dict[str, CaptureQuality] = {
    "fast": CaptureQuality(2, 1.0),
    "default": CaptureQuality(3, 2.9),
    "fine": CaptureQuality(4, 4.0),
}
DEFAULT_NEAR_M = 0.05  # of the virtual cameras
DEFAULT_QUALITY: QualityName = "default"


def quality_named(name: str) -> CaptureQuality:
    """Capture quality of a name.

    Raises:
        OpticsError: there is no such quality.
    """
    if name in QUALITIES:
        return QUALITIES[name]
    raise OpticsError(f"quality {name!r}: {did_you_mean(name, QUALITIES)}")
