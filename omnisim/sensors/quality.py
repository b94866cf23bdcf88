"""How finely a picture is captured, by a name or by numbers.

Both numbers are about one thing, jagged edges and lost detail, at two places: the virtual cameras
take so many texels to a side of the picture's finest pixels, and the capture looks so many times to
a side of each pixel and averages. The names are settings where neither is finer than the other can
show.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from omnisim.errors import OpticsError, did_you_mean

MAX_SUPERSAMPLING = 8
MIN_DENSITY, MAX_DENSITY = 0.25, 8.0  # texels of the virtual cameras to a side of a pixel

QualityName = Literal["fast", "default", "fine"]


class Quality(NamedTuple):
    """How finely a picture is captured.

    Attributes:
        supersampling: captured pixels to a side of a pixel of the picture.
        texels_per_pixel: texels of the virtual cameras to a side of the picture's finest pixels.
    """

    supersampling: int
    texels_per_pixel: float


QUALITIES: dict[str, Quality] = {
    "fast": Quality(2, 1.0),
    "default": Quality(3, 2.9),
    "fine": Quality(4, 4.0),
}
DEFAULT_QUALITY: QualityName = "default"


def quality_named(name: str) -> Quality:
    """What a name stands for.

    Raises:
        OpticsError: there is no such quality.
    """
    if name in QUALITIES:
        return QUALITIES[name]
    raise OpticsError(f"quality {name!r}: {did_you_mean(name, QUALITIES)}")
