"""JPEG compression of the camera, by a real encoder and decoder.

Source: ITU-T T.81.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from omnisim.core.arrays import Bytes
from omnisim.core.files.parameters import Typical
from omnisim.rendering.camera.degradations.effect import Effect


@dataclass(frozen=True)
class Jpeg(Effect, name="degradation.jpeg"):
    """JPEG encoding and decoding; the image stays black outside of its mask."""

    quality: Annotated[int, Field(strict=True, ge=1, le=100), Typical(75.0, 95.0)] = 90
    """Quality on libjpeg's scale; 30 for a cheap stream."""
    subsampling: Literal["4:4:4", "4:2:2", "4:2:0"] = "4:2:0"
    """Chroma subsampling."""

    def compressed(self, rgba: Bytes) -> Bytes:
        """Image (height, width, 4) after JPEG; alpha is kept."""
        from omnisim.core.files.image_files import through_jpeg  # with OpenImageIO, slow to import

        result = rgba.copy()
        result[..., :3] = through_jpeg(rgba[..., :3], self.quality, self.subsampling)
        result[rgba[..., 3] == 0, :3] = 0
        return result
