"""Capture quality: texels of the virtual cameras and samples per pixel, by name or by number.

Both numbers control jagged edges and lost detail: texels per side of the image's finest pixels,
and samples per pixel side, which are averaged. The named settings balance them: more texels would
need more samples to be visible, and more samples more texels.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from omnisim.core.errors import OpticsError, did_you_mean

MAX_IMAGE_PX = 32768  # limit of current GPUs; the actual GPU may allow less
MAX_SUPERSAMPLING = 8
MIN_DENSITY, MAX_DENSITY = 0.25, 8.0  # texels of the virtual cameras per pixel side

QualityName = Literal["fast", "default", "fine"]


class CaptureQuality(NamedTuple):
    """Texels and samples of a capture.

    Attributes:
        supersampling: samples per pixel side of the image.
        texels_per_pixel: texels of the virtual cameras per side of the image's finest pixels.
    """

    supersampling: int
    texels_per_pixel: float


QUALITIES: dict[str, CaptureQuality] = {
    "fast": CaptureQuality(2, 1.0),
    "default": CaptureQuality(3, 2.9),
    "fine": CaptureQuality(4, 4.0),
}
DEFAULT_NEAR_M = 0.05  # of the virtual cameras
# Numbers of planar mirrors that virtual cameras reflect the scene in, and of panes.
DEFAULT_MIRRORS, MAX_MIRRORS = 4, 8
# Numbers of reflection probes, which curved and rough surfaces reflect.
DEFAULT_PROBES, MAX_PROBES = 8, 16
DEFAULT_QUALITY: QualityName = "default"


def quality_named(name: str) -> CaptureQuality:
    """Capture quality by name.

    Raises:
        OpticsError: the name is unknown.
    """
    if name in QUALITIES:
        return QUALITIES[name]
    raise OpticsError(f"quality {name!r}: {did_you_mean(name, QUALITIES)}")
