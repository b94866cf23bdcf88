"""All that a camera does to the light that an ideal one would show, in the light's order.

mirror and lens (`reflectance`, `dirt`, `defocus`, `vignetting`, `chromatic_aberration`), then the
`shutter`, then the sensor (`exposure` with the colours' response, `noise`, `bayer`), then what the
camera computes (`white_balance`, `encoding`, `jpeg`).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from omnisim.errors import OpticsError
from omnisim.gpu.degradation.degradation_pass import Step
from omnisim.sensors.degradations.bayer import Bayer
from omnisim.sensors.degradations.chromatic_aberration import ChromaticAberration
from omnisim.sensors.degradations.defocus import Defocus
from omnisim.sensors.degradations.dirt import Dirt
from omnisim.sensors.degradations.encoding import Encoding
from omnisim.sensors.degradations.exposure import Exposure
from omnisim.sensors.degradations.jpeg import Jpeg
from omnisim.sensors.degradations.noise import Noise
from omnisim.sensors.degradations.parameters import Parameters
from omnisim.sensors.degradations.picture_geometry import PictureGeometry
from omnisim.sensors.degradations.reflectance import Reflectance
from omnisim.sensors.degradations.shutter import Shutter
from omnisim.sensors.degradations.vignetting import Vignetting
from omnisim.sensors.degradations.white_balance import WhiteBalance


@dataclass(frozen=True)
class Degradation:
    """What a camera lacks to be ideal; None: nothing of that kind. By default it is ideal.

    Raises:
        OpticsError: dark current without an exposure time.
    """

    reflectance: Reflectance | None = None
    dirt: Dirt | None = None
    defocus: Defocus | None = None
    vignetting: Vignetting | None = None
    chromatic_aberration: ChromaticAberration | None = None
    shutter: Shutter | None = None
    exposure: Exposure | None = None
    noise: Noise | None = None
    bayer: Bayer | None = None
    white_balance: WhiteBalance | None = None
    encoding: Encoding | None = None
    jpeg: Jpeg | None = None

    def __post_init__(self) -> None:
        if self.noise and self.noise.dark_current_e_per_s > 0.0 and self.exposure_s == 0.0:
            raise OpticsError(
                "degradation.noise.dark_current_e_per_s = "
                f"{self.noise.dark_current_e_per_s:g}: needs degradation.shutter.exposure_s"
            )

    @property
    def parts(self) -> dict[str, Parameters]:
        """What is switched on, by the names of the tables, in the light's order."""
        parts = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return {name: part for name, part in parts.items() if part is not None}

    @property
    def is_ideal(self) -> bool:
        """Whether nothing is switched on."""
        return not self.parts

    @property
    def exposure_s(self) -> float:
        """How long a row collects light; 0: an instant."""
        return 0.0 if self.shutter is None else self.shutter.exposure_s or 0.0

    @property
    def is_metered(self) -> bool:
        """Whether the exposure depends on the picture."""
        return self.exposure is not None and self.exposure.auto

    def tables(self) -> dict[str, dict[str, Any]]:
        """The tables of a sensor file that switch the same on."""
        return {name: part.values() for name, part in self.parts.items()}

    def scaled(self, scale: float) -> Degradation:
        """The same in a picture `scale` times as large."""
        return dataclasses.replace(
            self, **{name: part.scaled(scale) for name, part in self.parts.items()}
        )

    def optics_steps(self, geometry: PictureGeometry) -> list[Step]:
        """What the GPU does to light before the shutter."""
        parts = (
            self.reflectance,
            self.dirt,
            self.defocus,
            self.vignetting,
            self.chromatic_aberration,
        )
        return [step for part in parts if part for step in part.steps(geometry)]

    def sensor_steps(self, geometry: PictureGeometry, key: int) -> list[Step]:
        """What the GPU does after the shutter, up to the linear picture.

        Args:
            geometry: of the picture.
            key: of the camera's random numbers.
        """
        steps = []
        if self.exposure or self.white_balance:
            steps.append(Step("exposure"))
        if self.noise:
            steps += self.noise.steps(geometry, key, self.exposure_s)
        for part in (self.bayer, self.white_balance):
            if part:
                steps += part.steps(geometry)
        return steps

    def encoding_step(self, geometry: PictureGeometry) -> Step | None:
        """What makes the numbers of the file, where it is not the ideal camera's."""
        return self.encoding.steps(geometry)[0] if self.encoding else None

    def exposure_factors(self, ev: float) -> tuple[float, float, float]:
        """What red, green and blue light is multiplied by at an exposure."""
        response = self.white_balance.response if self.white_balance else (1.0, 1.0, 1.0)
        red, green, blue = (2.0**ev * part for part in response)
        return red, green, blue
