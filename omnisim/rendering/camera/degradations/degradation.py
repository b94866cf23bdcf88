"""Degradation of a camera: its effects, in the order of the light path."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from omnisim.core.arrays import Floats32
from omnisim.core.errors import OpticsError
from omnisim.core.short_repr import short_repr
from omnisim.rendering.camera.degradations.image_geometry import Metering

if TYPE_CHECKING:  # an ideal camera needs none of them
    from omnisim.rendering.camera.degradations.bayer import Bayer
    from omnisim.rendering.camera.degradations.chromatic_aberration import ChromaticAberration
    from omnisim.rendering.camera.degradations.defocus import Defocus
    from omnisim.rendering.camera.degradations.dirt import Dirt
    from omnisim.rendering.camera.degradations.effect import Effect, OpticalEffect, SensorEffect
    from omnisim.rendering.camera.degradations.encoding import Encoding
    from omnisim.rendering.camera.degradations.exposure import Exposure
    from omnisim.rendering.camera.degradations.image_geometry import (
        EffectStep,
        ImageGeometry,
        LinearImage,
    )
    from omnisim.rendering.camera.degradations.jpeg import Jpeg
    from omnisim.rendering.camera.degradations.noise import Noise
    from omnisim.rendering.camera.degradations.point_spread import PointSpread
    from omnisim.rendering.camera.degradations.reflectance import Reflectance
    from omnisim.rendering.camera.degradations.shutter import Shutter
    from omnisim.rendering.camera.degradations.vignetting import Vignetting
    from omnisim.rendering.camera.degradations.white_balance import WhiteBalance


@dataclass(frozen=True, kw_only=True)
class Degradation:
    """Degradation of a camera: one field per effect; None: disabled. By default all are disabled.

    The fields are in the order of the light path.

    Raises:
        OpticsError: dark current without an exposure time.
    """

    reflectance: Reflectance | None = None
    dirt: Dirt | None = None
    defocus: Defocus | None = None
    point_spread: PointSpread | None = None
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
            setting = f"noise.dark_current_e_per_s = {self.noise.dark_current_e_per_s:g}"
            raise OpticsError(f"degradation.{setting}: needs degradation.shutter.exposure_s")

    def __repr__(self) -> str:
        return short_repr(self, *(self.parts or ("ideal",)))

    @property
    def parts(self) -> dict[str, Effect]:
        """Enabled effects, by table name."""
        parts = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return {name: part for name, part in parts.items() if part is not None}

    @property
    def is_ideal(self) -> bool:
        """True if all effects are disabled."""
        return not self.parts

    @property
    def exposure_s(self) -> float:
        """Exposure time of a row in seconds; 0: instantaneous."""
        return 0.0 if self.shutter is None else self.shutter.exposure_s or 0.0

    @property
    def meter(self) -> Metering | None:
        """Light meter of auto-exposure; None: the exposure does not depend on the image."""
        return None if self.exposure is None else self.exposure.meter

    @property
    def is_metered(self) -> bool:
        """True if the exposure depends on the image."""
        return self.meter is not None

    def tables(self) -> dict[str, dict[str, Any]]:
        """Sensor file tables of the enabled effects."""
        return {name: part.to_table(full=True) for name, part in self.parts.items()}

    def scaled(self, scale: float) -> Degradation:
        """The same degradation for an image with `scale` times the resolution."""
        parts: dict[str, Any] = {name: part.scaled(scale) for name, part in self.parts.items()}
        return Degradation(**parts)

    @property
    def optics(self) -> list[OpticalEffect]:
        """Effects before the shutter."""
        from omnisim.rendering.camera.degradations.effect import OpticalEffect

        return [part for part in self.parts.values() if isinstance(part, OpticalEffect)]

    @property
    def electronics(self) -> list[SensorEffect]:
        """Effects after the shutter, up to the linear image.

        With white balance, they include an exposure, which applies its factors.
        """
        from omnisim.rendering.camera.degradations.effect import SensorEffect
        from omnisim.rendering.camera.degradations.exposure import Exposure

        whole = self
        if self.white_balance and not self.exposure:
            whole = dataclasses.replace(self, exposure=Exposure())
        return [part for part in whole.parts.values() if isinstance(part, SensorEffect)]

    def optics_steps(self, geometry: ImageGeometry) -> list[EffectStep]:
        """GPU passes before the shutter."""
        return [step for effect in self.optics for step in effect.steps(geometry)]

    def sensor_steps(self, geometry: ImageGeometry, noise_key: int) -> list[EffectStep]:
        """GPU passes after the shutter, up to the linear image; the key is that of the noise."""
        from omnisim.rendering.camera.degradations.effect import Shot

        shot = Shot(exposure_s=self.exposure_s, noise_key=noise_key)
        return [step for effect in self.electronics for step in effect.steps(geometry, shot)]

    def encoding_step(self) -> EffectStep | None:
        """GPU pass that encodes 8 bits; None: the encoding is that of an ideal camera."""
        return self.encoding.step() if self.encoding else None

    def exposure_factors(self, ev: float) -> tuple[float, float, float]:
        """Factors of red, green and blue light at an exposure of `ev` stops."""
        response = self.white_balance.response if self.white_balance else (1.0, 1.0, 1.0)
        red, green, blue = (2.0**ev * part for part in response)
        return red, green, blue

    def exposed(
        self, sub_frames: Iterable[tuple[LinearImage, Floats32 | None]], geometry: ImageGeometry
    ) -> LinearImage:
        """Light (height, width, 4) collected by the sensor, in NumPy.

        Args:
            sub_frames: at least one ideal image, each with its share (height,) of the rows'
                exposure; None: the whole frame.
            geometry: geometry of the images.

        Raises:
            ValueError: there is no sub-frame.
        """
        total: LinearImage | None = None
        for image, row_weights in sub_frames:
            for effect in self.optics:
                image = effect.apply(image, geometry)
            if row_weights is not None:
                image = image.copy()
                image[..., :3] *= row_weights[:, None, None]
                if total is not None:
                    image[..., :3] += total[..., :3]
            total = image
        if total is None:
            raise ValueError("expected a sub-frame, got none")
        return total

    def developed(
        self,
        image: LinearImage,
        geometry: ImageGeometry,
        factors: tuple[float, float, float],
        noise_key: int,
        frame_number: int,
    ) -> LinearImage:
        """Linear image (height, width, 4) that the sensor makes from collected light, in NumPy.

        Args:
            image: collected light.
            geometry: geometry of the image.
            factors: exposure factors of red, green and blue light.
            noise_key, frame_number: see `Shot`.
        """
        from omnisim.rendering.camera.degradations.effect import Shot

        shot = Shot(factors, self.exposure_s, noise_key, frame_number)
        for effect in self.electronics:
            image = effect.apply(image, geometry, shot)
        return image


# Modules by effect, imported at first use: an ideal camera needs none of them. A field is named as
# its module, and annotated by its class, or None.
EFFECT_MODULES = {
    str(field.type).partition(" ")[0]: field.name for field in dataclasses.fields(Degradation)
}
