"""Exposure, and auto-exposure with a lag.

Light is multiplied by 2 to the power of the exposure, before the sensor counts its photons.
Auto-exposure acts as an iris: the shutter time, and thus motion blur, stays the same. A first-order
filter follows the metered exposure of the previous image. The typical values are assumptions.

Source: ISO 12232 and APEX, for stops; a gray card's 18 % is a convention of photography.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from omnisim.core.files.parameters import NotNegative, Number, Positive, Typical
from omnisim.rendering.camera.degradations.effect import DEFAULT_SHOT, Ev, SensorEffect, Shot
from omnisim.rendering.camera.degradations.image_geometry import (
    EffectStep,
    ImageGeometry,
    LinearImage,
    Metering,
)
from omnisim.rendering.camera.degradations.reflectance import multiplied


@dataclass(frozen=True, kw_only=True)
class Exposure(SensorEffect, name="degradation.exposure"):
    """A fixed exposure, or one that follows the luminance of the image with a lag."""

    ev: Ev = 0.0
    """Exposure value (EV): power of two that multiplies the light."""
    auto: bool = False
    """Enables auto-exposure."""
    target: Positive = 0.18
    """Linear luminance that auto-exposure gives to the metered level; a gray card has 0.18."""
    metering: Literal["percentile", "mean"] = "percentile"
    """Metered level of auto-exposure: a percentile of the pixels' luminances, which a bright window
    does not raise, or their mean, which it does."""
    percentile: Annotated[Number, Field(gt=0.0, le=100.0)] = 50.0
    """Percentile that is metered, unless the mean is; 50: the median."""
    time_constant_s: Annotated[NotNegative, Typical(0.1, 0.5)] = 0.2
    """Time in seconds to adapt to 63 % of a change of light."""
    min_ev: Ev = -4.0
    """Minimum EV of auto-exposure."""
    max_ev: Ev = 6.0
    """Maximum EV of auto-exposure."""

    def _check(self) -> None:
        if self.min_ev > self.max_ev:
            raise self._error("min_ev", f"at most max_ev = {self.max_ev:g}")

    def steps(self, geometry: ImageGeometry, shot: Shot = DEFAULT_SHOT) -> list[EffectStep]:
        """One GPU pass, with factors set for each frame."""
        return [EffectStep("exposure")]

    def apply(
        self, image: LinearImage, geometry: ImageGeometry, shot: Shot = DEFAULT_SHOT
    ) -> LinearImage:
        """Reference in NumPy."""
        return multiplied(image, shot.exposure_factors)

    @property
    def meter(self) -> Metering | None:
        """Light meter; None: a fixed exposure."""
        percentile = self.percentile if self.metering == "percentile" else None
        return Metering(percentile) if self.auto else None

    def metered_ev(self, luminance: float) -> float:
        """Metered exposure in stops, from an image's metered luminance before exposure."""
        if not self.auto:
            return self.ev
        if luminance <= 0.0:
            return self.max_ev
        metered = math.log2(self.target / luminance) + self.ev
        return min(max(metered, self.min_ev), self.max_ev)

    def next_ev(self, ev: float, metered_ev: float, later_s: float) -> float:
        """Exposure of the next image in stops, `later_s` after one with exposure `ev`."""
        if not self.auto:
            return self.ev
        if self.time_constant_s == 0.0:
            return metered_ev
        return ev + (metered_ev - ev) * -math.expm1(-later_s / self.time_constant_s)
