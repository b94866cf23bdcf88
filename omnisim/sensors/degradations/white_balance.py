"""White balance: what the sensor makes of white, and what the camera makes of that.

| key | unit | typical |
| --- | --- | --- |
| response | relative signals of R, G and B pixels in the scene's light | 0.6, 1, 0.7 (assumed) |
| gains | factors of R, G, B after demosaicking; "grey": undo `response` | "grey" |

Source: von Kries' diagonal model of adaptation, 1902, which cameras' channel gains are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from omnisim.gpu.degradation.degradation_pass import Step
from omnisim.parameters import keyword_or
from omnisim.sensors.degradations.parameters import SMALLEST, Parameters, Positive
from omnisim.sensors.degradations.picture_geometry import Picture, PictureGeometry
from omnisim.sensors.degradations.reflectance import multiplied

Factor = Annotated[Positive, Field(le=100.0)]


def _are_factors(value: Any) -> bool:
    return (
        isinstance(value, list | tuple)
        and len(value) == 3
        and all(type(part) in (int, float) and SMALLEST <= part <= 100.0 for part in value)
    )


def _as_tuple(value: Any) -> Any:
    return value if isinstance(value, str) else tuple(value)


Gains = Annotated[
    Any,
    keyword_or("grey", "three numbers above 0, at most 100,", _are_factors),
    AfterValidator(_as_tuple),
]


@dataclass(frozen=True)
class WhiteBalance(Parameters):
    """Light is multiplied by `response` before the noise, and by `gains` after demosaicking."""

    response: tuple[Factor, Factor, Factor] = (1.0, 1.0, 1.0)
    gains: Gains = "grey"

    @property
    def factors(self) -> tuple[float, float, float]:
        """The gains of red, green and blue."""
        if self.gains == "grey":
            return tuple(1.0 / part for part in self.response)
        return self.gains

    def steps(self, geometry: PictureGeometry) -> list[Step]:
        """On the GPU: the gains; the response is a part of the exposure."""
        return [Step("colour_factors", {"u_factors": self.factors})]

    def apply(self, picture: Picture, geometry: PictureGeometry) -> Picture:
        """Reference: the same in NumPy."""
        return multiplied(picture, self.factors)
