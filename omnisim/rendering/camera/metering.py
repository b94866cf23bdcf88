"""Light meter of auto-exposure: reduces an image to one luminance.

A percentile is robust. The median ignores a bright window or lamp that fills less than half of the
image, so the room around it does not turn black. The mean follows the brightest parts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from omnisim.core.array_types import Float32s, Floats

LUMINANCE = (0.2126, 0.7152, 0.0722)  # weights of linear red, green and blue, Rec. 709


@dataclass(frozen=True)
class Metering:
    """Statistic of the valid pixels' luminances."""

    percentile: float | None = None  # percentile, linearly interpolated; None: mean

    def of_image(self, image: Float32s) -> float:
        """Metered luminance (Rec. 709) of an image (height, width, 4); 0 without valid pixels.

        NumPy reference of shaders/degradation/meter.frag and luminance.frag.
        """
        pixels = image[image[..., 3] > 0.5, :3].astype(np.float64)
        return self.of_luminances(pixels @ np.array(LUMINANCE))

    def of_luminances(self, luminances: Floats) -> float:
        """Metered luminance of pixels (n,); 0 if there are none."""
        if luminances.size == 0:
            return 0.0
        if self.percentile is None:
            return float(np.mean(luminances))
        return float(np.percentile(luminances, self.percentile))
