"""White balance: the sensor's response to white, and the camera's gains.

Source: von Kries' diagonal model of adaptation, 1902, which matches a camera's channel gains.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from omnisim.core.files.parameters import IntOrFloat, Positive, described
from omnisim.core.files.table_faults import MIN_POSITIVE
from omnisim.rendering.camera.degradations.effect import DEFAULT_SHOT, SensorEffect, Shot
from omnisim.rendering.camera.degradations.image_geometry import (
    EffectStep,
    ImageGeometry,
    LinearImage,
)
from omnisim.rendering.camera.degradations.reflectance import multiplied

Factor = Annotated[Positive, Field(le=100.0)]
Gain = Annotated[IntOrFloat, Field(ge=MIN_POSITIVE, le=100.0)]
Gains = Annotated[
    Literal["gray"] | tuple[Gain, Gain, Gain],
    described("three numbers above 0, at most 100, or 'gray'"),
]


@dataclass(frozen=True)
class WhiteBalance(SensorEffect, name="degradation.white_balance"):
    """White-balance factors: `response` before the noise, `gains` after demosaicing."""

    response: tuple[Factor, Factor, Factor] = (1.0, 1.0, 1.0)
    """Relative signals of R, G, B pixels in the scene's light; typically 0.6, 1, 0.7 (assumed)."""
    gains: Gains = "gray"
    """Factors of R, G, B after demosaicing; "gray": the inverse of response."""

    @property
    def factors(self) -> tuple[float, float, float]:
        """Gains of red, green and blue."""
        if self.gains == "gray":
            red, green, blue = self.response
            return 1.0 / red, 1.0 / green, 1.0 / blue
        return self.gains

    def steps(self, geometry: ImageGeometry, shot: Shot = DEFAULT_SHOT) -> list[EffectStep]:
        """One GPU pass, for the gains; the response is part of the exposure."""
        return [EffectStep("color_factors", {"u_factors": self.factors})]

    def apply(
        self, image: LinearImage, geometry: ImageGeometry, shot: Shot = DEFAULT_SHOT
    ) -> LinearImage:
        """Reference in NumPy."""
        return multiplied(image, self.factors)
